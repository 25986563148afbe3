"""End a command by Ctrl-C or SIGTERM with a defined exit code, at any moment."""

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

_LATER = 0.02  # s, until an interrupt that an import has put off comes again
_IMPORT = "<frozen importlib._bootstrap>"  # file name of the code that imports


def run_interruptible(work: Callable[[], int]) -> None:
    """End the process with the code that `work` returns, or with 130 when Ctrl-C or SIGTERM ended it.

    A KeyboardInterrupt inside an import can get lost, as in the callbacks of its locks, or turn into another error. So it waits
    for the end of the import. Where code that is being compiled raises it (that of data classes is), CPython ends by the signal
    although the exception was caught.
    """
    interrupted: list[bool] = []

    def interrupt(_: int, frame: FrameType | None) -> None:
        interrupted.append(True)
        if _imports(frame):
            signal.setitimer(signal.ITIMER_REAL, _LATER)
            return
        raise KeyboardInterrupt

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # otherwise the caller wants it ignored
        signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
    signal.signal(signal.SIGALRM, interrupt)
    try:
        # The interpreter that started this one blocked it.
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        code = work()
    except Exception:
        if not interrupted:
            raise
        code = 130
    except KeyboardInterrupt:
        code = 130
    if interrupted:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def _imports(frame: FrameType | None) -> bool:
    """Whether `frame` or one that called it imports a module."""
    while frame is not None:
        if frame.f_code.co_filename == _IMPORT:
            return True
        frame = frame.f_back
    return False
