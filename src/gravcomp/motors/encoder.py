"""Counting turns of a C610's rotor over the wrap at 8192, telling a jump from motion, and knowing when turns cannot be told.

The angle names the count up to whole turns. How far the rotor can have turned since the last feedback, by the speeds that it
reported then and now, is an interval:

    low  = min(0, v, v_last) (dt + TIME_UNCERTAINTY) - TOLERANCE - a dt^2 / 4
    high = max(0, v, v_last) (dt + TIME_UNCERTAINTY) + TOLERANCE + a dt^2 / 4

It begins at none, since feedbacks come late: a rotor that seems to have had dt to turn may have had less. `a dt^2 / 4` is how
far it gets beside a steady motion when it speeds up and slows down again in between. Of the counts with this angle

- none is in the interval: a jump. A corrupted frame, or two controllers with the same id;
- one is: it is the count;
- several are: the one nearest to (v + v_last) / 2 x dt is taken, and the count is `certain` no more. It may be off by whole turns.

What comes next may tell: when a receiver was held up, its frames come all at once, and for a count that has a turn too many there was
no time since the doubt began. A distance d needs at least the t of |d| - tolerance = v t + a t^2 / 4, with the greater speed v of its two
ends; all of them have to fit between the arrivals. Until this is known, or SETTLING_TIME is over, the encoder is `settling`.

A rotor that stood before and stands now at the same angle has not moved, however long the silence.
"""

import dataclasses
import math

from gravcomp.description.hardware import COUNTS_PER_TURN

JUMPS = 4
"""So many implausible feedbacks are an encoder fault, two plausible ones making up for one implausible: four in a row, or
every other one, as from two controllers with the same id."""

SETTLING_TIME = 0.2
"""s of feedback after which turns in doubt stay so: a receiver that was held up may be so again before it has caught up."""

_COUNTS_PER_S = COUNTS_PER_TURN / 60.0  # a rpm
_TOLERANCE = 400.0  # counts, at standstill
_STEP_TOLERANCE = 20.0  # counts, between two feedbacks whose turns are certain
_TIME_UNCERTAINTY = 0.008  # s, of the frames' arrival
_ACCELERATION = 2e6  # counts/s^2 of a; 0.2 m/s^2 of the cable
_REST_SPEED, _REST_ANGLE = 30.0, 200.0  # rpm, counts (0.02 mm of cable): it stands, and where it stood
_SPEED_LIMIT = 20_000  # rpm of the rotor: beyond what the motor can do
_SPEED_JUMP, _SPEED_RATE = 4000.0, 6e5  # rpm, rpm/s at full current: beyond what it can do between two feedbacks


@dataclasses.dataclass
class _Doubt:
    """The arrival of the last feedback before the doubt and of the first in it (s); by which whole turns the count may be off, and the
    least time (s) that the rotor needs for what it has then turned since.
    """

    begin: float
    since: float
    needed: dict[int, float]


class Encoder:
    """The rotor's count (not wrapped) since its first feedback. Attributes: count (counts), speed (rpm), current (A), time (s), jumps
    (implausible feedbacks less half the plausible ones since), rejected (since start).
    """

    def __init__(self) -> None:
        self.count: int | None = None
        self.speed, self.current, self.time = 0.0, 0.0, -math.inf
        self.jumps, self.rejected = 0.0, 0
        self._take_any = self._unsure = False
        self._doubt: _Doubt | None = None

    @property
    def certain(self) -> bool:
        """Whether the whole turns of the count are."""
        return not self._unsure and self._doubt is None

    @property
    def settling(self) -> bool:
        """Whether the next feedbacks will tell the whole turns, or that they cannot be told."""
        return not self._unsure and self._doubt is not None

    def update(self, angle: int, speed: float, current: float, now: float) -> bool:
        """Take a feedback: angle in counts, rotor speed in rpm, current in A, arrival in s. False when it is implausible."""
        if not 0 <= angle < COUNTS_PER_TURN or abs(speed) > _SPEED_LIMIT:
            return self._reject()
        if self.count is None:
            self.count = angle
        elif self._take_any:
            self.count += round(_wrap(angle - self.count))
        elif not self._follow(angle, speed, now):
            return self._reject()
        self.speed, self.current, self.time, self._take_any = speed, current, now, False
        self.jumps = max(0.0, self.jumps - 0.5)
        return True

    def resynchronise(self) -> None:
        """Take the next feedback whatever its angle, at the nearest turn."""
        self.jumps, self._take_any = 0.0, True
        self._give_up()

    def trust(self) -> None:
        """The count is right: somebody says so, or the zero was found anew."""
        self._unsure, self._doubt = False, None

    def forget(self) -> None:
        """The turns are lost: count anew from the next feedback."""
        self.count, self.jumps, self._take_any = None, 0.0, False
        self.trust()

    def restore(self, count: int, speed: float, time: float, certain: bool) -> None:
        """Go on from what someone else kept: the count and the speed (rpm) at `time` (s)."""
        self.count, self.speed, self.time = count, speed, time
        self.jumps, self._take_any = 0.0, False
        self._unsure, self._doubt = not certain, None

    def _follow(self, angle: int, speed: float, now: float) -> bool:
        """Move the count to `angle`; False when the rotor cannot have got there."""
        elapsed = max(0.0, now - self.time)
        if abs(speed - self.speed) > _SPEED_JUMP + _SPEED_RATE * elapsed:
            return False
        slowest, fastest = min(0.0, speed, self.speed) * _COUNTS_PER_S, max(0.0, speed, self.speed) * _COUNTS_PER_S
        beside = 0.25 * _ACCELERATION * elapsed * elapsed
        low = slowest * (elapsed + _TIME_UNCERTAINTY) - beside - _TOLERANCE
        high = fastest * (elapsed + _TIME_UNCERTAINTY) + beside + _TOLERANCE
        turned = _wrap(angle - self.count)
        if abs(speed) < _REST_SPEED and abs(self.speed) < _REST_SPEED and abs(turned) < _REST_ANGLE:
            turns = [0]
        else:
            predicted = 0.5 * (speed + self.speed) * _COUNTS_PER_S * elapsed
            first = low + (angle - self.count - low) % COUNTS_PER_TURN
            if first > high:
                return False
            turned = predicted + _wrap(angle - self.count - predicted)
            if not low <= turned <= high:
                turned = first
            before = round((turned - first) / COUNTS_PER_TURN)
            turns = [k - before for k in range(1 + int((high - first) // COUNTS_PER_TURN))]
        self.count += round(turned)
        if self._doubt is None and len(turns) > 1:
            self._doubt = _Doubt(self.time, now, {0: 0.0})
        if self._doubt is not None:
            tolerance = _TOLERANCE if len(turns) > 1 else _STEP_TOLERANCE
            needed = {k: _least_time(turned + k * COUNTS_PER_TURN, slowest, fastest, tolerance) for k in turns}
            self._settle(needed, now)
        return True

    def _settle(self, needed: dict[int, float], now: float) -> None:
        """Leave out the counts that the rotor had no time for; `needed`: what the last feedback may be off by, and the least time for it."""
        doubt, room = self._doubt, now - self._doubt.begin + _TIME_UNCERTAINTY
        together: dict[int, float] = {}
        for before, spent in doubt.needed.items():
            for turns, time in needed.items():
                if spent + time <= room:
                    together[before + turns] = min(spent + time, together.get(before + turns, math.inf))
        doubt.needed = together
        if not together or now - doubt.since > SETTLING_TIME:
            self._give_up()
        elif len(together) == 1:
            self.count += next(iter(together)) * COUNTS_PER_TURN
            self._doubt = None

    def _give_up(self) -> None:
        self._unsure, self._doubt = True, None

    def _reject(self) -> bool:
        self.jumps += 1
        self.rejected += 1
        return False


def _least_time(distance: float, slowest: float, fastest: float, tolerance: float) -> float:
    """s that the rotor needs for the distance (counts) between two feedbacks with these speeds (counts/s; at most, at least 0)."""
    speed = fastest if distance > 0.0 else -slowest
    distance = max(0.0, abs(distance) - tolerance)
    return (math.sqrt(speed * speed + _ACCELERATION * distance) - speed) * 2.0 / _ACCELERATION


def _wrap(counts: float) -> float:
    """Into [-4096, 4096)."""
    return (counts + COUNTS_PER_TURN // 2) % COUNTS_PER_TURN - COUNTS_PER_TURN // 2
