"""How a run on the virtual robot is carried out: the robot, where many alike computations go, and who hears of the progress."""

from collections.abc import Callable
from typing import Any, TypeVar

from gravcomp.closed_loop.setup import Setup
from gravcomp.sweep import Sweep

Made = TypeVar("Made")


class Context:
    """How an experiment is run.

    setup; sweep: where many alike computations go; progress(sentence): tells people what is being done; brief: shorter runs, for
    a first look and for tests (the report says so).
    """

    def __init__(self, setup: Setup, sweep: Sweep, progress: Callable[[str], None] = lambda sentence: None, brief: bool = False):
        self.setup, self.sweep, self.progress, self.brief = setup, sweep, progress, brief
        self._made: dict[Callable, Any] = {}

    def once(self, make: "Callable[[Context], Made]") -> "Made":
        """What `make(context)` returns, made once for all experiments that ask for it."""
        if make not in self._made:
            self._made[make] = make(self)
        return self._made[make]

    def map(self, function: Callable, jobs: list, what: str) -> list:
        """`sweep.map` that tells how far it is."""
        self.progress(f"{what} (0 of {len(jobs)})")
        return self.sweep.map(function, jobs, lambda done, total: self.progress(f"{what} ({done} of {total})"))
