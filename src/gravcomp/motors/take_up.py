"""Taking up the backlash of a gear: a motor at rest ends on the flank that winds in.

A motor that pays out turns back inside the backlash of its gear. Where the cable pulls less than what holds the capstan there,
the capstan stays behind, and the cable is shorter than its winch says, by up to the backlash. The rotor does not show it. But a
rotor that pays out by the whole backlash more and winds in again has the capstan on the flank that winds in, wherever it was:
the approach from one side, as of machine tools.

How loose the gear may be follows from the rotor as in a play operator of the largest backlash w:

    x = min(w, max(0, x_last - (d - d_last))),   d: displacement of the rotor; 0: on the flank that winds in

A target that stays is taken up once, so that nothing moves at rest.

The motors of a robot go out and in again at the same time, when all their targets stay: antagonists that pay out together leave
the tip where it is. One alone pushes it aside, and as long as its antagonist is still too short, the tip rests aside, too.

Noise of the IMU moves a target out of its band for some samples. One that has not gone farther than a target that
creeps, and comes back at once, has stayed there; nor does that end a take-up that has begun.

A target that creeps also stays for a while. It leaves its band slowly, and the next one only counts as rest when it stays there
for `_STAYS` times as long as in the last, or for `_LATEST` rests. So a target that creeps steadily or turns round on a parabola
is not taken up: a parabola spends at most (1 + sqrt(2))^2 times as long in the band around its vertex as in the one before.
"""

import dataclasses
import enum
import math
from collections.abc import Sequence

from gravcomp.description.hardware import Drive

_SPREAD = 1.0 / 3.0  # of the described backlash, by which that of a gear is larger at most
_LEAST = 0.2  # of the backlash: what is left loose, and by how much a target moves that stays
_WAY = 1.0 / 3.0  # of the rest before: time in which the motor winds in again
_STAYS = (1.0 + math.sqrt(2.0)) ** 2  # stays of a target that creeps, after which it rests
_CREEPS = 2.0  # bands: a target that has gone farther between two steps has not crept
_LATEST = 30.0  # of the rest: a small step after a long rest is taken up, too
_BACK = 1.0 / 3.0  # of the rest: a target that comes back within it has stayed


class _Phase(enum.Enum):
    NONE = 0
    OUT = 1
    IN = 2


@dataclasses.dataclass
class _Stay:
    """A target that stays in a band.

    target: in the middle of the band, in m; rest: s after which it is at rest; since: s for which it stays; done: the backlash
    has been taken up for it; phase: of this.
    """

    target: float
    rest: float
    since: float = 0.0
    done: bool = False
    phase: _Phase = _Phase.NONE


class TakeUp:
    """Takes up the backlash of one motor that only pulls.

    Attributes, set by `act_together`: waits (for the other motors of the robot), joins (one of them begins).
    """

    def __init__(self, drive: Drive, rest_error: float, stay: float = 0.0):
        """rest_error: distance in m from its target at which the position loop is at rest.

        stay: time in s for which the motor stays out before it winds in.
        """
        play = drive.backlash * drive.capstan_radius
        self._width, self._least = (1.0 + _SPREAD) * play, _LEAST * play
        self._over = self._width + 2.0 * rest_error
        self._rest_error, self._farthest, self._time = rest_error, drive.displacement_min, drive.take_up_time
        self._stay_out = stay
        self._acts = self._time > 0.0 and self._least > rest_error
        self._speed = min(drive.velocity_limit, self._over / (_WAY * self._time)) if self._acts else drive.velocity_limit
        self.waits = self.joins = False
        self.reset()

    def reset(self) -> None:
        """Start with the gear on the flank that winds in, as homing leaves it."""
        self._loose, self._out = 0.0, 0.0
        self._last: float | None = None  # displacement
        self._stay: _Stay | None = None
        self._left: _Stay | None = None  # to which the target may come back, `_away` s after it has left
        self._away = 0.0

    @property
    def stays(self) -> bool:
        """Whether the target has stayed for the time of a rest, creeping or not."""
        return not self._acts or (self._stay is not None and self._stay.since >= self._time)

    @property
    def is_due(self) -> bool:
        """Whether the target is at rest, and the gear may be loose."""
        return self._is_loose and self._stay is not None and self._stay.since >= self._stay.rest

    @property
    def moves(self) -> bool:
        """Whether the motor takes up the backlash now."""
        return self._stay is not None and self._stay.phase is not _Phase.NONE

    def step(self, target: float, displacement: float, dt: float, setpoint: float | None = None) -> tuple[float, float | None]:
        """Return where the motor goes now on its way to `target`, in m, and how fast at most in m/s; None: as fast as it may.

        displacement (m) is that of the rotor, `dt` (s) the time since the last step. setpoint: that of a rotor (m) of which it is
        not known how exactly it comes to rest; the motor is then out, and back, when its setpoint is.
        """
        if not self._acts:
            return target, None
        moved = 0.0 if self._last is None else displacement - self._last
        self._loose, self._last = min(self._width, max(0.0, self._loose - moved)), displacement
        stay = self._stay = self._stayed(target, dt)
        stay.since += dt
        if stay.phase is _Phase.NONE and self._begins(target):
            stay.phase, self._out, stay.done = _Phase.OUT, 0.0, True
        place = displacement if setpoint is None else setpoint
        outward = max(target - self._over, self._farthest)  # the target may tremble after the take-up has begun
        if stay.phase is _Phase.OUT and place <= outward + self._rest_error:
            self._out += dt
            stay.phase = _Phase.IN if self._out > self._stay_out else _Phase.OUT
        if stay.phase is _Phase.IN and place >= target - self._rest_error:
            stay.phase = _Phase.NONE
        if stay.phase is _Phase.OUT:
            return outward, None
        return target, self._speed if stay.phase is _Phase.IN else None

    def _stayed(self, target: float, dt: float) -> _Stay:
        """Return in which band the target (m) stays now, `dt` s after the last step."""
        last, left = self._stay, self._left
        if last is None:
            return _Stay(target, self._time)
        self._away += dt
        if left is not None and (self._away > _BACK * self._time or abs(target - left.target) > _CREEPS * self._least):
            left = self._left = None
        if left is not None and abs(target - left.target) <= self._least:
            self._left, left.since = None, left.since + self._away
            return left
        crept = abs(target - last.target) <= _CREEPS * self._least
        if abs(target - last.target) <= self._least or (crept and last.phase is not _Phase.NONE):
            return last
        rest = min(max(1.0, _STAYS * last.since / self._time), _LATEST) * self._time if crept else self._time
        if crept and left is None:
            self._left, self._away = last, 0.0
        return _Stay(target, rest)

    @property
    def _is_loose(self) -> bool:
        return self._acts and self._loose > self._least and not (self._stay is not None and self._stay.done)

    def _begins(self, target: float) -> bool:
        allowed = not self.waits and (self.is_due or self.joins)
        return allowed and self._is_loose and target - self._over >= self._farthest


def act_together(take_ups: Sequence[TakeUp | None]) -> None:
    """Let the motors of a robot begin at the same time: as soon as all targets stay and one is at rest with a loose gear."""
    own = [take_up for take_up in take_ups if take_up is not None]
    begin = all(take_up.stays for take_up in own) and any(take_up.is_due for take_up in own)
    for take_up in own:
        take_up.waits, take_up.joins = not begin, begin


def targets_to_hold(targets: Sequence[float], take_ups: Sequence[TakeUp | None], setpoints: Sequence[float]) -> list[float]:
    """Return targets (m) that keep motors at their setpoints (m); one that takes up its backlash goes on to its target."""
    return [
        target if take_up is not None and take_up.moves else setpoint
        for target, take_up, setpoint in zip(targets, take_ups, setpoints)
    ]
