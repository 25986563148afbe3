"""Finding the zero of each cable: wind it in until it is taut; zero is where it began to pull.

The current of a slack cable is the gear's friction. Once taut it rises with the cable's tension, nearly linearly:

    i(x) = i_0 + s max(0, x - x_0)

x_0, fitted by least squares over all samples of the winding, is the zero; a threshold alone would add the path on which
the tension built up. The other cables hang slack meanwhile; at the end all go to their zeros together. The slack
taken out of each cable is reported.
"""

import dataclasses
import enum

from gravcomp.description.hardware import Drive, Homing

_SETTLE = 0.25  # s of winding before its current counts as the slack cable's
_SMOOTHING = 0.02  # s, of the current that is compared with the threshold
_RISE_TIME = 0.04  # s above the threshold
_ARRIVED = 5e-5  # m
_PHASE_TIMEOUT = 60.0  # s


class Phase(enum.Enum):
    SLACKEN = "letting all cables out"
    WIND = "winding in"
    RELAX = "letting out"
    TO_ZERO = "going to zero"
    DONE = "done"
    FAILED = "failed"


@dataclasses.dataclass(frozen=True)
class Knee:
    """Where a current began to rise: `position` (m), the current before it (A), the slope after it (A/m)."""

    position: float
    current: float
    slope: float


def find_knee(position: list[float], current: list[float]) -> Knee:
    """The least-squares hinge i_0 + s max(0, x - x_0) through samples (m, A); positions need not be sorted."""
    import numpy as np

    x, i = np.asarray(position), np.asarray(current)
    best = None
    low, high = float(x.min()), float(x.max())
    for _ in range(3):  # a grid refined twice: 0.01 of the range, then of the neighbourhood of the best
        for knee in np.linspace(low, high, 41):
            ramp = np.maximum(0.0, x - knee)
            design = np.column_stack((np.ones_like(x), ramp))
            solution = np.linalg.lstsq(design, i, rcond=None)[0]
            cost = float(np.sum((design @ solution - i) ** 2))
            if best is None or cost < best[0]:
                best = (cost, Knee(float(knee), float(solution[0]), float(solution[1])))
        width = (high - low) / 20
        low, high = best[1].position - width, best[1].position + width
    return best[1]


class HomingProcedure:
    """Homes all cables, one after the other. `step` gives where each shall be; then `phase`, `zeros`, `report` tell the result.

    Attributes: phase, zeros (m per cable, in the displacement measured since the procedure began), report (text), failure (text).
    """

    def __init__(self, homing: Homing, drive: Drive, cables: tuple[str, ...], displacement: list[float], now: float):
        self._homing, self._drive, self._cables = homing, drive, cables
        self._start = list(displacement)
        self.targets = [x - homing.slack for x in displacement]
        self.zeros: list[float | None] = [None] * len(cables)
        self.phase, self.failure = Phase.SLACKEN, ""
        self._cable, self._since = 0, now
        self._lines: list[str] = []

    @property
    def report(self) -> str:
        return "; ".join(self._lines)

    @property
    def progress(self) -> str:
        name = self._cables[self._cable] if self.phase in (Phase.WIND, Phase.RELAX) else ""
        return f"homing: {self.phase.value} {name}".rstrip()

    def step(self, displacement: list[float], current: list[float], now: float) -> list[float]:
        """Targets (m) for the loops, which move no faster than `homing.velocity`; `current` (A) as measured."""
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
            self._fail(f"{self.phase.value} did not end within {_PHASE_TIMEOUT:.0f} s")
        return self.targets

    def _arrived(self, displacement: list[float]) -> bool:
        return all(abs(x - target) < _ARRIVED for x, target in zip(displacement, self.targets))

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
        if displacement - self._from > self._homing.travel_limit + self._homing.slack - 1e-4:
            self._fail(
                f"{cable} was wound in by {1e3 * self._homing.travel_limit:.0f} mm without getting taut: "
                "is it broken, unhooked, or is `direction` wrong?"
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
            self.zeros[self._cable] = knee.position
            slack = 1e3 * (knee.position - self._start[self._cable])
            self._lines.append(f"{cable}: {slack:+.2f} mm of slack taken out, running current {knee.current:.3f} A")
            self.targets[self._cable] = knee.position - self._homing.slack
            self.phase, self._since = Phase.RELAX, now

    def _fail(self, why: str) -> None:
        self.phase, self.failure = Phase.FAILED, why
