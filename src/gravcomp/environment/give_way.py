"""Low priority for processes that compute for minutes next to others that must keep their rate."""

import contextlib
import os

_NICENESS = 19


def give_way(niceness: int = _NICENESS, process: int = 0) -> None:
    """Lower the priority of a process, by default this one, and of what it starts; also for a `preexec_fn`.

    Linux first compares sessions (autogroups), and the niceness of processes only within a session. So that of a process that
    leads a session of its own is lowered, too. A process that has ended already has no priority.
    """
    process = process or os.getpid()
    with contextlib.suppress(ProcessLookupError):
        os.setpriority(os.PRIO_PROCESS, process, min(os.getpriority(os.PRIO_PROCESS, process) + niceness, _NICENESS))
        if os.getsid(process) == process:
            with contextlib.suppress(OSError), open(f"/proc/{process}/autogroup", "w", encoding="utf-8") as autogroup:
                autogroup.write(str(niceness))
