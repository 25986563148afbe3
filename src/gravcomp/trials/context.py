"""Context of a run on the virtual robot: the robot, the sweep that runs independent computations, and the progress display."""

from collections.abc import Callable
from typing import Any, TypeVar

from gravcomp.closed_loop.setup import Setup
from gravcomp.sweep import Sweep

Made = TypeVar("Made")


class Context:
    """Context in which an experiment runs.

    setup: robot, controller and virtual robot; sweep: runs independent computations in parallel; progress(stage): shows the
    user the current stage; brief: shorter runs, for a first look and for tests (the report notes it).
    """

    def __init__(self, setup: Setup, sweep: Sweep, progress: Callable[[str], None] = lambda stage: None, brief: bool = False):
        self.setup, self.sweep, self.progress, self.brief = setup, sweep, progress, brief
        self._made: dict[Callable, Any] = {}

    def once(self, make: "Callable[[Context], Made]") -> "Made":
        """Return `make(context)`, computed once and shared by all experiments of this context."""
        if make not in self._made:
            self._made[make] = make(self)
        return self._made[make]

    def map(self, function: Callable, jobs: list, stage: str) -> list:
        """Return `sweep.map(function, jobs)`, showing the number of finished jobs next to the name of the stage."""
        self.progress(f"{stage} (0 of {len(jobs)})")
        return self.sweep.map(function, jobs, lambda done, total: self.progress(f"{stage} ({done} of {total})"))
