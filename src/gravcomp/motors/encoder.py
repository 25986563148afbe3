"""Counting the turns of a C610's rotor: its angle wraps at 8192, and feedback may be late, lost or wrong.

The angle gives the count up to whole turns. The speeds in the last feedback (v_last) and in this one (v) bound how far the
rotor can have turned in between:

    low  = min(0, v, v_last) (dt + TIME_UNCERTAINTY) - TOLERANCE - a dt^2 / 4
    high = max(0, v, v_last) (dt + TIME_UNCERTAINTY) + TOLERANCE + a dt^2 / 4

The interval contains 0 because feedback may come late: the rotor may have had less time than dt. `a dt^2 / 4` is the additional
distance of a rotor that accelerates and decelerates again in between. The number of counts with this angle in the interval
decides:

- none: the angle jumped. The frame is corrupted, or two controllers have the same id;
- one: it is the count;
- several: the one nearest to (v + v_last) / 2 x dt is taken. The count is no longer `certain`: it may be off by whole turns.

Later feedback may decide between several counts. When a receiver was delayed, its frames come all at once, and a count with a
turn too many would have needed more time than has passed since the doubt began. A distance d takes at least the time t of
|d| - tolerance = v t + a t^2 / 4, where v is the larger speed of its two ends; the sum of these times must fit between the
arrivals. Until the turns are decided, or SETTLING_TIME is over, the encoder is `settling`.

A rotor that was at rest before and is at rest now at the same angle has not moved, however long the silence was.
"""

import dataclasses
import math

from gravcomp.description.hardware import COUNTS_PER_TURN
from gravcomp.motors.state import RotorRecord

JUMPS = 4
"""Implausible feedbacks that make an encoder fault. Two plausible ones cancel one implausible, so that the fault needs four in a
row, or every other one, as from two controllers with the same id."""

SETTLING_TIME = 0.2
"""s of feedback after which undecided turns stay uncertain. A receiver may be delayed again before it has caught up."""

_COUNTS_PER_S = COUNTS_PER_TURN / 60.0  # per rpm
_TOLERANCE = 400.0  # counts, at rest
_STEP_TOLERANCE = 20.0  # counts, between two feedbacks with certain turns
_TIME_UNCERTAINTY = 0.008  # s, of the arrival of a frame
_ACCELERATION = 2e6  # counts/s^2, the `a` above; 0.2 m/s^2 of the cable
_REST_SPEED, _REST_ANGLE = 30.0, 200.0  # rpm, counts (0.02 mm of cable): at rest, at the same angle
_SPEED_LIMIT = 20_000  # rpm of the rotor; more than the motor reaches
_SPEED_JUMP, _SPEED_RATE = 4000.0, 6e5  # rpm, rpm/s at full current; more than the speed can change between two feedbacks


def countable_speed(interval: float) -> float:
    """Return the speed (rpm) up to which feedback every `interval` s tells the turns of a rotor that turns steadily."""
    room = COUNTS_PER_TURN - 2.0 * _TOLERANCE - 0.5 * _ACCELERATION * interval * interval
    return room / ((interval + _TIME_UNCERTAINTY) * _COUNTS_PER_S)


def stays_countable(speed: float, silence: float) -> bool:
    """Return whether a rotor that turns at `speed` (rpm) before and after a silence (s) of its feedback keeps its count of turns.

    It does at rest, and where a whole turn more takes longer than the silence.
    """
    if abs(speed) < _REST_SPEED:
        return True
    return _least_time(COUNTS_PER_TURN, 0.0, abs(speed) * _COUNTS_PER_S, _TOLERANCE) > silence + _TIME_UNCERTAINTY


@dataclasses.dataclass
class _Doubt:
    """An undecided number of turns."""

    begin: float  # s, arrival of the last feedback before the doubt
    since: float  # s, arrival of the first feedback in doubt
    needed: dict[int, float]  # possible error of the count (turns) -> least time (s) for the distance turned since then


class Encoder:
    """Counts the turns of one rotor.

    Attributes: count (counts, not wrapped; None before the first feedback); speed (rpm), current (A) and time (s) of the last
    feedback; jumps (implausible feedbacks minus half of the plausible ones since then); rejected (implausible ones in total).
    """

    def __init__(self) -> None:
        self.count: int | None = None
        self.speed, self.current, self.time = 0.0, 0.0, -math.inf
        self.jumps, self.rejected = 0.0, 0
        self._take_any = self._unsure = False
        self._doubt: _Doubt | None = None

    @property
    def certain(self) -> bool:
        """Whether the number of whole turns in the count is certain."""
        return not self._unsure and self._doubt is None

    @property
    def settling(self) -> bool:
        """Whether the number of turns is in doubt and the next feedbacks may still decide it."""
        return not self._unsure and self._doubt is not None

    def update(self, angle: int, speed: float, current: float, now: float) -> bool:
        """Take a feedback: angle (counts), rotor speed (rpm), current (A), arrival (s). Return False when it is implausible."""
        if not 0 <= angle < COUNTS_PER_TURN or abs(speed) > _SPEED_LIMIT:
            return self._reject()
        if self.count is None:
            self.count = angle
        elif self._take_any:
            self.count += round(_wrap(angle - self.count))
        elif not self._follow(self.count, angle, speed, now):
            return self._reject()
        self.speed, self.current, self.time, self._take_any = speed, current, now, False
        self.jumps = max(0.0, self.jumps - 0.5)
        return True

    def resynchronise(self) -> None:
        """Accept any angle in the next feedback, at the nearest turn. The turns are uncertain from then on."""
        self.jumps, self._take_any = 0.0, True
        self._give_up()

    def trust(self) -> None:
        """Take the count as certain: the user has confirmed it, or homing has found the zero position."""
        self._unsure, self._doubt = False, None

    def forget(self) -> None:
        """Begin to count again with the next feedback."""
        self.count, self.jumps, self._take_any = None, 0.0, False
        self.trust()

    def record(self, zero: int) -> RotorRecord | None:
        """Return what is needed to continue counting, with the zero position (counts); None before the first feedback."""
        return None if self.count is None else RotorRecord(self.count, zero, self.speed, self.time, self.certain)

    def restore(self, rotor: RotorRecord) -> None:
        """Continue counting from a record."""
        self.count, self.speed, self.time = rotor.count, rotor.speed, rotor.time
        self.jumps, self._take_any = 0.0, False
        self._unsure, self._doubt = not rotor.certain, None

    def _follow(self, count: int, angle: int, speed: float, now: float) -> bool:
        """Move from `count` to `angle`. Return False when the rotor cannot have got there."""
        elapsed = max(0.0, now - self.time)
        if abs(speed - self.speed) > _SPEED_JUMP + _SPEED_RATE * elapsed:
            return False
        slowest, fastest = min(0.0, speed, self.speed) * _COUNTS_PER_S, max(0.0, speed, self.speed) * _COUNTS_PER_S
        detour = 0.25 * _ACCELERATION * elapsed * elapsed
        low = slowest * (elapsed + _TIME_UNCERTAINTY) - detour - _TOLERANCE
        high = fastest * (elapsed + _TIME_UNCERTAINTY) + detour + _TOLERANCE
        turned = _wrap(angle - count)
        if abs(speed) < _REST_SPEED and abs(self.speed) < _REST_SPEED and abs(turned) < _REST_ANGLE:
            turns = [0]
        else:
            predicted = 0.5 * (speed + self.speed) * _COUNTS_PER_S * elapsed
            first = low + (angle - count - low) % COUNTS_PER_TURN
            if first > high:
                return False
            turned = predicted + _wrap(angle - count - predicted)
            if not low <= turned <= high:
                turned = first
            before = round((turned - first) / COUNTS_PER_TURN)
            turns = [k - before for k in range(1 + int((high - first) // COUNTS_PER_TURN))]
        self.count = count + round(turned)
        if self._doubt is None and len(turns) > 1:
            self._doubt = _Doubt(self.time, now, {0: 0.0})
        if self._doubt is not None:
            tolerance = _TOLERANCE if len(turns) > 1 else _STEP_TOLERANCE
            needed = {k: _least_time(turned + k * COUNTS_PER_TURN, slowest, fastest, tolerance) for k in turns}
            self.count += self._settle(self._doubt, needed, now) * COUNTS_PER_TURN
        return True

    def _settle(self, doubt: _Doubt, needed: dict[int, float], now: float) -> int:
        """Exclude the counts that the rotor had no time to reach. Return the correction (turns) when one count remains, else 0.

        `needed`: the possible errors (turns) of the step to the last feedback, and the least time (s) for each.
        """
        room = now - doubt.begin + _TIME_UNCERTAINTY
        together: dict[int, float] = {}
        for before, spent in doubt.needed.items():
            for turns, time in needed.items():
                if spent + time <= room:
                    together[before + turns] = min(spent + time, together.get(before + turns, math.inf))
        doubt.needed = together
        if not together or now - doubt.since > SETTLING_TIME:
            self._give_up()
        elif len(together) == 1:
            self._doubt = None
            return next(iter(together))
        return 0

    def _give_up(self) -> None:
        self._unsure, self._doubt = True, None

    def _reject(self) -> bool:
        self.jumps += 1
        self.rejected += 1
        return False


def _least_time(distance: float, slowest: float, fastest: float, tolerance: float) -> float:
    """Return the least time (s) for a distance (counts), with speeds at its ends in [slowest, fastest] (counts/s)."""
    speed = fastest if distance > 0.0 else -slowest
    distance = max(0.0, abs(distance) - tolerance)
    return (math.sqrt(speed * speed + _ACCELERATION * distance) - speed) * 2.0 / _ACCELERATION


def _wrap(counts: float) -> float:
    """Wrap into [-4096, 4096)."""
    return (counts + COUNTS_PER_TURN // 2) % COUNTS_PER_TURN - COUNTS_PER_TURN // 2
