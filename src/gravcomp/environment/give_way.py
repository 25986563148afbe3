"""Low priority for processes that compute for minutes next to others that must keep their rate."""

import contextlib
import os

_NICENESS = 19


def give_way(niceness: int = _NICENESS) -> None:
    """Lower the priority of this process and of what it starts; also for a `preexec_fn`.

    Linux first compares sessions (autogroups), and the niceness of processes only within a session. So a process that leads a
    session of its own lowers that, too.
    """
    os.nice(niceness)
    if os.getsid(0) == os.getpid():
        with contextlib.suppress(OSError), open("/proc/self/autogroup", "w") as autogroup:
            autogroup.write(str(niceness))
