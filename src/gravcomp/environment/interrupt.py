"""Ctrl-C ends a command with its own code, at whatever moment it comes."""

import os
import signal
import sys
from collections.abc import Callable


def run_interruptible(work: Callable[[], int]) -> None:
    """End the process with the code that `work` returns, with 130 where Ctrl-C or SIGTERM ended it.

    A KeyboardInterrupt may strike inside an import. There it can become another error, and where it passes through text that is being
    compiled, as that of data classes is, CPython ends by the signal although it was caught.
    """
    interrupted = []

    def interrupt(*_):
        interrupted.append(True)
        raise KeyboardInterrupt

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else whoever started this wants it ignored
        signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
    try:
        # Blocked by the interpreter that started this one, until here.
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
