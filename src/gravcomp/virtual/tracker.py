"""A tracker of the virtual robot's tip: late, noisy, with dropouts and outliers."""

import collections
from typing import NamedTuple

import numpy as np

from gravcomp.graph.parameters.virtual_tracker import VirtualTrackerParameters
from gravcomp.virtual.truth import Truth


class Measured(NamedTuple):
    """A measurement: time in s since the start of the virtual robot, position (3,) in m and orientation (4,) in soft_base."""

    time: float
    position: np.ndarray
    orientation: np.ndarray


class VirtualTracker:
    """Measures the tip at the rate of `parameters`. The same seed gives the same measurements."""

    def __init__(self, parameters: VirtualTrackerParameters, length: float, seed: int):
        """length in m: of the robot."""
        self._parameters, self._length = parameters, length
        self._random = np.random.default_rng([seed, 5])
        self._due = 0.0
        self._under_way: collections.deque[Measured] = collections.deque()

    def observe(self, truth: Truth) -> list[Measured]:
        """Measure if a measurement is due; return what has arrived by now. Call it more often than the tracker's rate."""
        p = self._parameters
        if p.rate > 0.0 and truth.time >= self._due - 1e-9:
            self._due = max(self._due + 1.0 / p.rate, truth.time)
            lost, wild = self._random.random(2) < (p.dropouts, p.outliers)
            noise, anywhere = p.std * self._random.standard_normal(3), self._random.uniform(-1.0, 1.0, 3)
            position = self._length * anywhere if wild else truth.tip_position + noise
            if not lost:
                self._under_way.append(Measured(truth.time, position, truth.tip_orientation))
        arrived = []
        while self._under_way and self._under_way[0].time + p.delay <= truth.time + 1e-9:
            arrived.append(self._under_way.popleft())
        return arrived
