"""The process that builds a robot's reduced model while its nodes already run on the full model."""

import os
import subprocess
import sys

from gravcomp.environment.end_with_parent import end_with_parent

MARK = "GRAVCOMP_MODEL_BUILDER"
"""Environment variable that tells nodes that their launcher builds the reduced model."""


class ModelBuilder:
    """Builds the reduced model of `robot` (a shipped name or a path) in a process of low priority, from `start` on.

    The process ends with the context. A build that is interrupted goes on at the next start (`gravcomp.training.background`).
    `environment`: variables for the nodes of the graph.
    """

    def __init__(self, robot: str):
        self._robot = robot
        self._process: subprocess.Popen | None = None
        self.environment = {MARK: "1"}

    def __enter__(self) -> "ModelBuilder":
        return self

    def start(self) -> None:
        """Start the process. Call it when the nodes have started: their imports and its own would wait for each other."""
        self._process = start_builder(self._robot)

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.terminate()
            self._process.wait()


def start_builder(robot: str) -> subprocess.Popen:
    """Start the building process; it ends by itself, or with the thread that calls this. Its progress goes to stderr."""
    return subprocess.Popen(
        [sys.executable, "-m", "gravcomp.training.background", robot],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C reaches the launcher alone
        preexec_fn=end_with_parent,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
    )
