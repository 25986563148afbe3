"""Processes that do not outlive the process that started them."""

import ctypes
import signal

_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None)


def end_with_parent(number: int = signal.SIGTERM) -> None:
    """Let the kernel send this signal to this process when its parent ends, however that happens; also for a `preexec_fn`."""
    _LIBC.prctl(_PR_SET_PDEATHSIG, number)
