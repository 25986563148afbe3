"""Scheduling priority for the processes that serve the bus: hardware does not wait for other processes."""

import contextlib
import os
import threading

_NICENESS = -5


def take_precedence() -> None:
    """Raise the priority of the calling thread and of the threads that it starts from now on.

    Without the right to do so (`ulimit -e` shows the limit) the priority stays as it is. Linux first compares sessions
    (autogroups), and the niceness of threads only within a session; the launcher starts each node in its own session. So both
    are set.
    """
    with contextlib.suppress(OSError), open("/proc/self/autogroup", "w", encoding="utf-8") as autogroup:
        autogroup.write(str(_NICENESS))
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
