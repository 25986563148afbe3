"""What is done while a mesh is made or chosen, which takes up to minutes: as the packages below log it, with the seconds."""

import contextlib
import logging
import time
from collections.abc import Callable, Iterator

from gravcomp.commands import output


@contextlib.contextmanager
def mesh_steps(what: str) -> Iterator[None]:
    """Show `what`, then each step as it begins: on a terminal in one line that goes again, else as notes on stderr."""
    logger = logging.getLogger("gravcomp")
    with output.stages(what) as show:
        terminal = output.console().is_terminal
        if not terminal:
            output.note(what)
        handler = _Steps((lambda text: show(f"{what}: {text}")) if terminal else output.note)
        before = logger.level
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
        try:
            yield
        finally:
            logger.removeHandler(handler)
            logger.setLevel(before)


class _Steps(logging.Handler):
    """Gives what is logged for information to a function; warnings are printed as without this handler."""

    def __init__(self, show: Callable[[str], None]):
        super().__init__(logging.INFO)
        self._show, self._start = show, time.monotonic()

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno == logging.INFO:
            self._show(f"{time.monotonic() - self._start:.0f} s: {record.getMessage()}")
        elif logging.lastResort is not None and not logging.getLogger().handlers:
            logging.lastResort.handle(record)  # logging uses it only where there is no handler at all
