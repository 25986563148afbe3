"""Command line of a forked process as `ps` and /proc show it.

Own code, because the package setproctitle writes one string: programs that read /proc/PID/cmdline then find one argument in
place of the list. The kernel reads the command line from the process's own memory (proc(5): arg_start and arg_end in
/proc/PID/stat), so overwriting it there is enough.
"""

import ctypes
from pathlib import Path

PADDING = "-" * 2000
"""Last argument of a process that is to be renamed: a title can be no longer than the command line that it replaces."""

_PR_SET_NAME = 15
_LIBC = ctypes.CDLL(None)


def set_title(name: str, command: list[str]) -> None:
    """Show `command` as the command line of this process, and `name` (15 bytes at most) as its name."""
    _LIBC.prctl(_PR_SET_NAME, ctypes.c_char_p(name.encode()[:15]), 0, 0, 0)
    # The process's name in the second field may contain spaces; the third field follows the last parenthesis.
    fields = Path("/proc/self/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    begin, end = int(fields[45]), int(fields[46])
    if 0 < begin < end:
        text = b"".join(word.encode() + b"\0" for word in command)[: end - begin - 1]
        ctypes.memmove(begin, text.ljust(end - begin, b"\0"), end - begin)
