"""The last steps of the filter without the spikes of their samples.

A sample is decided some samples later, by `spikes` and `spike_review`. Where another value then counts for it, the filter goes
back to its state before that step and repeats the steps since then.
"""

import math
from collections import deque
from dataclasses import dataclass

from gravcomp.orientation.quaternion import Vector
from gravcomp.orientation.spike_review import AHEAD, SURE_ACCEL, SURE_GYRO, SpikeReview
from gravcomp.orientation.spikes import SpikeGate, SpikeOptions

# Of the threshold of a spike: an angle lacks for good what a wrong spike removes, a velocity is corrected all the time.
GATE_SURE_GYRO, GATE_SURE_ACCEL = 1.5, 1.0
PATIENCE_GYRO = 2.0  # its review finds what the gate overlooks; a wrong suspicion costs samples in fast motion


@dataclass
class Step:
    """dt in s; rate (3,) in rad/s and specific force (3,) in m/s^2 that count; whether each of them is usable.

    doubt: rad/s, by how much the rate that was measured differs from the one that counts until the next samples decide.
    """

    dt: float
    rate: Vector
    force: Vector
    gyro_usable: bool
    accel_usable: bool
    doubt: float = 0.0


class LastSteps:
    """Keeps as many steps as a decision may change, each with the state of the filter before it."""

    def __init__(self, options: SpikeOptions) -> None:
        self._gyro_gate = SpikeGate(options.gyro, options, GATE_SURE_GYRO, PATIENCE_GYRO)
        self._accel_gate = SpikeGate(options.accel, options, GATE_SURE_ACCEL)
        self._gyro_review = SpikeReview(options.gyro, options, SURE_GYRO)
        self._accel_review = SpikeReview(options.accel, options, SURE_ACCEL)
        self._kept: deque[tuple[tuple, Step]] = deque(maxlen=max(AHEAD, options.longest))

    def reset(self) -> None:
        """Forget the signals and the steps."""
        for part in (self._gyro_gate, self._accel_gate, self._gyro_review, self._accel_review):
            part.reset()
        self._kept.clear()

    def forget(self) -> None:
        """Forget the steps: no decision changes them any more."""
        self._kept.clear()

    def keep(self, state: tuple, step: Step) -> None:
        """Keep a step with the state before it."""
        self._kept.append((state, step))

    def take(self, step: Step, gap: bool) -> list[tuple[tuple, Step]]:
        """Let the values count in a new step that are no spikes. gap: samples are missing before it.

        Returns the last steps since the first one for which another value counts now, the oldest first; they are no longer kept.
        """
        changed = max(self._decide_rates(step, gap), self._decide_forces(step, gap))
        return [self._kept.pop() for _ in range(changed)][::-1]

    def _decide_rates(self, step: Step, gap: bool) -> int:
        """Set the step's rate; return how many steps are to be repeated."""
        if not step.gyro_usable:
            self._gyro_gate.reset()
            self._gyro_review.reset()
            return 0
        measured = step.rate
        step.rate, decided = _decided(self._gyro_gate, self._gyro_review, step.dt, measured, gap)
        step.doubt = math.dist(measured, step.rate)
        changed = 0
        for age, value in decided:
            earlier = self._earlier(age)
            if earlier is not None and earlier.rate != value:
                earlier.rate, earlier.doubt, changed = value, 0.0, max(changed, age)
        return changed

    def _decide_forces(self, step: Step, gap: bool) -> int:
        """Set the step's specific force; return how many steps are to be repeated."""
        if not step.accel_usable:
            self._accel_gate.reset()
            self._accel_review.reset()
            return 0
        step.force, decided = _decided(self._accel_gate, self._accel_review, step.dt, step.force, gap)
        changed = 0
        for age, value in decided:
            earlier = self._earlier(age)
            if earlier is not None and earlier.force != value:
                earlier.force, changed = value, max(changed, age)
        return changed

    def _earlier(self, age: int) -> Step | None:
        """Return the step `age` samples ago, None where it is not kept."""
        return self._kept[-age][1] if age <= len(self._kept) else None


def _decided(
    gate: SpikeGate, review: SpikeReview, dt: float, measured: Vector, gap: bool
) -> tuple[Vector, list[tuple[int, Vector]]]:
    """Return what counts for a new sample, and for earlier ones: how many samples ago, and the value (3,) that is decided."""
    if gap and dt > gate.options.time_constant:
        gate.reset()  # what the signal was like is forgotten
    value, counted = gate.take(dt, measured)
    decided = [(age, counted[-age]) for age in range(1, min(len(counted), AHEAD - 1) + 1)]  # the review decides older ones
    if gap:
        review.reset()
    final = review.take(dt, measured)
    return value, decided if final is None else [*decided, (AHEAD, final)]
