"""End a command by Ctrl-C or SIGTERM with a defined exit code, at any moment."""

import os
import signal
import sys
from collections.abc import Callable


def run_interruptible(work: Callable[[], int]) -> None:
    """End the process with the code that `work` returns, or with 130 when Ctrl-C or SIGTERM ended it.

    A KeyboardInterrupt may be raised inside an import. There it can turn into another error. When it passes through code that is
    being compiled (that of data classes is), CPython ends by the signal although the exception was caught.
    """
    interrupted: list[bool] = []

    def interrupt(*_: object) -> None:
        interrupted.append(True)
        raise KeyboardInterrupt

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # otherwise the caller wants it ignored
        signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
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
