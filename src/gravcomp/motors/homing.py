"""Homing: find the zero position of each cable by winding it in until it is taut.

The current of a slack cable overcomes the gear's friction only. When the cable is taut, the current rises nearly linearly with
its tension:

    i(x) = i_0 + s max(0, x - x_0)

The zero position is x_0, fitted by least squares to all samples of the winding; a threshold alone would add the distance in which
the tension builds up. The cables are homed one after the other while the others are slack; at the end all go to their zero
positions together. The report gives the slack of each cable.
"""

import dataclasses
import enum

from gravcomp.description.hardware import Drive, Homing

_SETTLE = 0.25  # s of winding before the current is sampled; in the next such time it gives the slack cable's current
_SMOOTHING = 0.02  # s, time constant of the current that is compared with the threshold
_RISE_TIME = 0.04  # s above the threshold until the cable counts as taut
_ARRIVED, _FARTHEST = 0.01, 0.02  # of the slack: from the target; before the end of the travel
_PHASE_TIMEOUT = 60.0  # s


class Phase(enum.Enum):
    """Phase of homing; the value describes it in messages."""

    SLACKEN = "paying all cables out"
    WIND = "winding in"
    RELAX = "paying out"
    TO_ZERO = "going to zero"
    DONE = "done"
    FAILED = "failed"


@dataclasses.dataclass(frozen=True)
class Knee:
    """Knee of a current over position: `position` (m), `current` before it (A), `slope` after it (A/m)."""

    position: float
    current: float
    slope: float


def find_knee(position: list[float], current: list[float]) -> Knee:
    """Fit i_0 + s max(0, x - x_0) to samples of position (m) and current (A) by least squares; positions need not be sorted."""
    import numpy as np

    x, i = np.asarray(position), np.asarray(current)
    best, least_cost = Knee(float(x.min()), 0.0, 0.0), float("inf")
    low, high = float(x.min()), float(x.max())
    for _ in range(3):  # a grid of 41 positions over the range, refined twice around the best one
        for knee in np.linspace(low, high, 41):
            ramp = np.maximum(0.0, x - knee)
            design = np.column_stack((np.ones_like(x), ramp))
            solution = np.linalg.lstsq(design, i, rcond=None)[0]
            cost = float(np.sum((design @ solution - i) ** 2))
            if cost < least_cost:
                best, least_cost = Knee(float(knee), float(solution[0]), float(solution[1])), cost
        width = (high - low) / 20
        low, high = best.position - width, best.position + width
    return best


class HomingProcedure:
    """Homes all cables, one after the other. `step` returns the target of each cable until `phase` is DONE or FAILED.

    Attributes: phase; zeros (m, one per cable homed so far, in the displacement measured since the procedure began); targets (m);
    failure (reason of FAILED).
    """

    def __init__(self, homing: Homing, drive: Drive, cables: tuple[str, ...], displacement: list[float], now: float):
        self._homing, self._drive, self._cables = homing, drive, cables
        self._start = list(displacement)
        self.targets = [x - homing.slack for x in displacement]
        self.zeros: list[float] = []
        self.phase, self.failure = Phase.SLACKEN, ""
        self._cable, self._since = 0, now
        self._lines: list[str] = []

    @property
    def report(self) -> str:
        """Slack and running current of the cables homed so far."""
        return "; ".join(self._lines)

    @property
    def progress(self) -> str:
        """Sentence that says what is being done."""
        name = self._cables[self._cable] if self.phase in (Phase.WIND, Phase.RELAX) else ""
        return f"homing: {self.phase.value} {name}".rstrip()

    def step(self, displacement: list[float], current: list[float], now: float) -> list[float]:
        """Return the targets (m) from measured displacement (m) and current (A). The loops use the velocity limit of homing."""
        if self.phase is Phase.SLACKEN and self._arrived(displacement):
            self._wind(0, displacement, now)
        elif self.phase is Phase.WIND:
            self._watch_rise(displacement[self._cable], current[self._cable], now)
        elif self.phase is Phase.RELAX and self._arrived(displacement):
            if self._cable + 1 < len(self._cables):
                self._wind(self._cable + 1, displacement, now)
            else:
                self.phase, self._since, self.targets = Phase.TO_ZERO, now, list(self.zeros)
        elif self.phase is Phase.TO_ZERO and self._arrived(displacement):
            self.phase = Phase.DONE
        if self.phase not in (Phase.DONE, Phase.FAILED) and now - self._since > _PHASE_TIMEOUT:
            self._fail(f"{self.phase.value} takes longer than {_PHASE_TIMEOUT:.0f} s")
        return self.targets

    def _arrived(self, displacement: list[float]) -> bool:
        return all(abs(x - target) < _ARRIVED * self._homing.slack for x, target in zip(displacement, self.targets))

    def _wind(self, cable: int, displacement: list[float], now: float) -> None:
        self.phase, self._cable, self._since = Phase.WIND, cable, now
        self._from = displacement[cable]
        self.targets[cable] = self._from + self._homing.travel_limit + self._homing.slack
        self._samples: list[tuple[float, float]] = []
        self._smooth: float | None = None
        self._baseline, self._baseline_samples = 0.0, 0
        self._risen_since: float | None = None
        self._last = now

    def _watch_rise(self, displacement: float, current: float, now: float) -> None:
        cable = self._cables[self._cable]
        if displacement - self._from > self._homing.travel_limit + (1.0 - _FARTHEST) * self._homing.slack:
            self._fail(
                f"{cable} was wound in by {1e3 * self._homing.travel_limit:.0f} mm and did not become taut: "
                "is it broken or unhooked, or is `direction` wrong?"
            )
            return
        if now - self._since < _SETTLE:
            return
        self._samples.append((displacement, current))
        weight = min(1.0, (now - self._last) / _SMOOTHING)
        self._last = now
        self._smooth = current if self._smooth is None else self._smooth + weight * (current - self._smooth)
        if now - self._since < 2 * _SETTLE:
            self._baseline_samples += 1
            self._baseline += (current - self._baseline) / self._baseline_samples
            return
        if self._smooth - self._baseline < self._homing.current_rise:
            self._risen_since = None
            return
        self._risen_since = now if self._risen_since is None else self._risen_since
        if now - self._risen_since >= _RISE_TIME:
            knee = find_knee([x for x, _ in self._samples], [i for _, i in self._samples])
            self.zeros.append(knee.position)
            slack = 1e3 * (knee.position - self._start[self._cable])
            self._lines.append(f"{cable}: {slack:+.2f} mm of slack removed, running current {knee.current:.3f} A")
            self.targets[self._cable] = knee.position - self._homing.slack
            self.phase, self._since = Phase.RELAX, now

    def _fail(self, why: str) -> None:
        self.phase, self.failure = Phase.FAILED, why
