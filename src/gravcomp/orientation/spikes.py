"""Spikes: single samples of a sensor that belong to no motion. They are held, without delay and without loss of motion.

A sample far from both the last good one and its extrapolation is a suspect; the extrapolation stands in for it. The following
samples decide. If they return to where the signal was, the suspect was a spike, and the straight line across it counts. If they
stay near the suspect, the sensor did turn that fast, and the suspect counts after all. In both cases the filter repeats the steps
since then, so a wrong suspicion costs a sample of delay (after a very large jump `longest` samples), not an error. What is far
follows the signal: a multiple of its mean innovation. (The test of an innovation by its scale is that of F. R. Hampel, JASA 1974,
69(346), 383-393.)
"""

from dataclasses import dataclass, field

from gravcomp.config import parameter
from gravcomp.orientation.quaternion import Vector

BOUND = 0.5  # of the threshold: a larger jump counts as this one in the mean jump, so that spikes hardly raise it
NEARER = 2.0  # ratio of the distances to the suspect and to the signal that decides
FAR = 2.0  # of the threshold: farther from the signal no sample has returned to it
CLEAR = 3.0  # of the threshold: a jump beyond this needs `longest` samples in a row to count as motion, a smaller one needs one


@dataclass(frozen=True)
class SpikeOptions:
    """What counts as a spike."""

    gyro: float = parameter(20.0, edge="deg/s", minimum=0.1, maximum=10000, description="a smaller jump of the rate is no spike")
    accel: float = parameter(
        3.0, unit="m/s^2", minimum=0.05, maximum=4000, description="a smaller jump of the specific force is no spike"
    )
    ratio: float = parameter(4.5, minimum=2, maximum=1000, description="jump of a spike, in mean jumps of the signal")
    time_constant: float = parameter(0.2, unit="s", minimum=0.02, maximum=10, description="of the mean jump")
    longest: int = parameter(2, minimum=1, maximum=10, description="spikes in a row; more are motion")


@dataclass
class SpikeGate:
    """One sensor of three axes; `count`: spikes held so far."""

    floor: float  # a smaller jump is no spike
    options: SpikeOptions
    sure: float  # of the threshold: what is nearer to the straight line counts as it is
    patience: float = 1.0  # factor of `options.ratio`: more where a later look finds what is overlooked here
    count: int = 0
    _last: Vector | None = None
    _slope: Vector = (0.0, 0.0, 0.0)  # change per sample
    _mean: float = 0.0
    _pending: list[Vector] = field(default_factory=list)  # suspects
    _clear: bool = False

    def reset(self) -> None:
        """Forget the signal: the next sample is good."""
        self._last, self._slope, self._mean = None, (0.0, 0.0, 0.0), 0.0
        self._pending.clear()

    def take(self, dt: float, value: Vector) -> tuple[Vector, list[Vector]]:
        """Return the value (3,) to use for a sample `dt` s after the last one, and what counts for the suspects before it.

        The list is empty unless this sample decides; it has a value (3,) for each of the last suspects.
        """
        last = self._last
        if last is None:
            self._last = value
            return value, []
        slope, pending = self._slope, self._pending
        steps = len(pending) + 1
        jump = 0.0
        for i in (0, 1, 2):
            difference = value[i] - last[i]
            off, ahead = abs(difference), abs(difference - steps * slope[i])
            off = ahead if ahead < off else off
            jump = off if off > jump else jump
        threshold = self.patience * self.options.ratio * self._mean
        threshold = self.floor if self.floor > threshold else threshold
        self._mean += dt / (self.options.time_constant + dt) * (min(jump, BOUND / self.patience * threshold) - self._mean)
        if not pending:
            if jump <= threshold:
                self._slope = (value[0] - last[0], value[1] - last[1], value[2] - last[2])
                self._last = value
                return value, []
            self._clear = jump > CLEAR * threshold
        elif self._is_return(value, jump, steps * threshold):
            return self._returned(value, threshold)
        elif self._is_motion(value, jump, threshold):
            return self._decide(value, list(pending))
        pending.append(value)
        return self._ahead(), []

    def _ahead(self) -> Vector:
        """Return what stands in for suspects: the last good value, extrapolated by one sample."""
        assert self._last is not None  # a suspect follows a good sample
        (a, b, c), (x, y, z) = self._last, self._slope
        return a + x, b + y, c + z

    def _is_return(self, value: Vector, jump: float, threshold: float) -> bool:
        """Return whether the signal is back where it was: near it, and much nearer to it than to the last suspect."""
        return jump <= FAR * threshold and NEARER * jump <= self._from_suspect(value)

    def _is_motion(self, value: Vector, jump: float, threshold: float) -> bool:
        if len(self._pending) >= self.options.longest:
            return True
        return not self._clear and NEARER * self._from_suspect(value) <= max(jump, threshold)

    def _from_suspect(self, value: Vector) -> float:
        return max(abs(v - s) for v, s in zip(value, self._pending[-1]))

    def _returned(self, value: Vector, threshold: float) -> tuple[Vector, list[Vector]]:
        """Count the straight line in place of the suspects that are far from it: they were spikes."""
        last, pending = self._last, self._pending
        assert last is not None
        counted: list[Vector] = []
        for k, suspect in enumerate(pending, 1):
            part = k / (len(pending) + 1)
            x, y, z = (a + (v - a) * part for a, v in zip(last, value))
            spike = bool(max(abs(suspect[0] - x), abs(suspect[1] - y), abs(suspect[2] - z)) > self.sure * threshold)
            self.count += spike
            counted.append((x, y, z) if spike else suspect)
        return self._decide(value, counted)

    def _decide(self, value: Vector, counted: list[Vector]) -> tuple[Vector, list[Vector]]:
        """Accept the value, and the values that count for the suspects."""
        x, y, z = (v - b for v, b in zip(value, counted[-1]))
        self._slope = (x, y, z)
        self._last = value
        self._pending.clear()
        return value, counted
