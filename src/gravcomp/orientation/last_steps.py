"""The last steps of the filter without the spikes of their samples.

A sample is decided some samples later, by `spikes` and `spike_review`. Where another value then counts for it, the filter goes
back to its state before that step and repeats the steps since then.
"""

from collections import deque
from dataclasses import dataclass

from gravcomp.orientation.quaternion import Vector
from gravcomp.orientation.spike_review import AHEAD, SpikeReview
from gravcomp.orientation.spikes import SpikeGate, SpikeOptions

# Of the threshold of a spike: an angle lacks for good what a wrong spike removes, a velocity is corrected all the time.
SURE_GYRO, SURE_ACCEL = 1.5, 1.0
PATIENCE_GYRO = 2.0  # its review finds what the gate overlooks; a wrong suspicion costs samples in fast motion


@dataclass
class Step:
    """dt in s; rate (3,) in rad/s and specific force (3,) in m/s^2 that count; whether each of them is usable."""

    dt: float
    rate: Vector
    force: Vector
    gyro_usable: bool
    accel_usable: bool


class LastSteps:
    """Keeps as many steps as a decision may change, each with the state of the filter before it."""

    def __init__(self, options: SpikeOptions) -> None:
        self._gyro_gate = SpikeGate(options.gyro, options, SURE_GYRO, PATIENCE_GYRO)
        self._accel_gate = SpikeGate(options.accel, options, SURE_ACCEL)
        self._review = SpikeReview(options.gyro, options)
        self._kept: deque[tuple[tuple, Step]] = deque(maxlen=max(AHEAD, options.longest))

    def reset(self) -> None:
        """Forget the signals and the steps."""
        self._gyro_gate.reset()
        self._accel_gate.reset()
        self._review.reset()
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
        changed = max(self._decide_rates(step, gap), self._decide_forces(step))
        return [self._kept.pop() for _ in range(changed)][::-1]

    def _decide_rates(self, step: Step, gap: bool) -> int:
        """Set the step's rate; return how many steps are to be repeated."""
        if not step.gyro_usable:
            self._gyro_gate.reset()
            self._review.reset()
            return 0
        changed, measured = 0, step.rate
        step.rate, counted = self._gyro_gate.take(step.dt, measured)
        for age in range(1, min(len(counted), AHEAD - 1) + 1):  # older ones are decided by the review
            earlier = self._earlier(age)
            if earlier is not None and earlier.rate != counted[-age]:
                earlier.rate, changed = counted[-age], age
        if gap:
            self._review.reset()
        decided, earlier = self._review.take(step.dt, measured), self._earlier(AHEAD)
        if decided is not None and earlier is not None and earlier.rate != decided:
            earlier.rate, changed = decided, AHEAD
        return changed

    def _decide_forces(self, step: Step) -> int:
        """Set the step's specific force; return how many steps are to be repeated."""
        if not step.accel_usable:
            self._accel_gate.reset()
            return 0
        changed = 0
        step.force, counted = self._accel_gate.take(step.dt, step.force)
        for age, value in enumerate(reversed(counted), 1):
            earlier = self._earlier(age)
            if earlier is not None and earlier.force != value:
                earlier.force, changed = value, age
        return changed

    def _earlier(self, age: int) -> Step | None:
        """Return the step `age` samples ago, None where it is not kept."""
        return self._kept[-age][1] if age <= len(self._kept) else None
