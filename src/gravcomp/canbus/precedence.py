"""Who serves the bus goes before other processes: hardware does not wait, and neither must the loop that drives it."""

import contextlib
import os
import threading

_NICENESS = -5


def take_precedence() -> None:
    """Let the calling thread, and the threads that it will start, go before other processes'.

    Where the user may not ask for it (`ulimit -e` says how far), the thread takes its turn. Linux weighs sessions against each other
    first and the niceness of threads only within one (its autogroups), and the launcher gives each node a session of its own.
    """
    with contextlib.suppress(OSError), open("/proc/self/autogroup", "w") as autogroup:
        autogroup.write(str(_NICENESS))
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
