"""Processes that do not outlive the process that started them."""

import ctypes
import signal

_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None)


def end_with_parent() -> None:
    """Let this process be ended by SIGTERM when its parent ends, however that happens; for the `preexec_fn` of a process."""
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
