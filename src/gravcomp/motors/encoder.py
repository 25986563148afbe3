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

A rotor that stood before and stands now at the same angle has not moved, however long the silence.
"""

import math

from gravcomp.description.hardware import COUNTS_PER_TURN

JUMPS = 4
"""So many implausible feedbacks are an encoder fault, two plausible ones making up for one implausible: four in a row, or
every other one, as from two controllers with the same id."""

_COUNTS_PER_S = COUNTS_PER_TURN / 60.0  # a rpm
_TOLERANCE = 400.0  # counts, at standstill
_TIME_UNCERTAINTY = 0.008  # s, of the frames' arrival
_ACCELERATION = 2e6  # counts/s^2 of a; 0.2 m/s^2 of the cable
_REST_SPEED, _REST_ANGLE = 30.0, 200.0  # rpm, counts (0.02 mm of cable): it stands, and where it stood
_SPEED_LIMIT = 20_000  # rpm of the rotor: beyond what the motor can do
_SPEED_JUMP, _SPEED_RATE = 4000.0, 6e5  # rpm, rpm/s at full current: beyond what it can do between two feedbacks


class Encoder:
    """The rotor's count (not wrapped) since its first feedback. Attributes: count (counts), certain (its whole turns are), speed
    (rpm), current (A), time (s), jumps (implausible feedbacks less half the plausible ones since), rejected (since start)."""

    def __init__(self) -> None:
        self.count: int | None = None
        self.certain = True
        self.speed, self.current, self.time = 0.0, 0.0, -math.inf
        self.jumps, self.rejected = 0.0, 0
        self._take_any = False

    def update(self, angle: int, speed: float, current: float, now: float) -> bool:
        """Take a feedback: angle in counts, rotor speed in rpm, current in A, arrival in s. False when it is implausible."""
        if not 0 <= angle < COUNTS_PER_TURN or abs(speed) > _SPEED_LIMIT:
            return self._reject()
        if self.count is None:
            self.count = angle
        elif self._take_any:
            self.count += round(_wrap(angle - self.count))
        elif not self._follow(angle, speed, max(0.0, now - self.time)):
            return self._reject()
        self.speed, self.current, self.time, self._take_any = speed, current, now, False
        self.jumps = max(0.0, self.jumps - 0.5)
        return True

    def resynchronise(self) -> None:
        """Take the next feedback whatever its angle, at the nearest turn."""
        self.jumps, self._take_any, self.certain = 0.0, True, False

    def trust(self) -> None:
        """The count is right: somebody says so, or the zero was found anew."""
        self.certain = True

    def forget(self) -> None:
        """The turns are lost: count anew from the next feedback."""
        self.count, self.jumps, self._take_any, self.certain = None, 0.0, False, True

    def restore(self, count: int, speed: float, time: float, certain: bool) -> None:
        """Go on from what someone else kept: the count and the speed (rpm) at `time` (s)."""
        self.count, self.speed, self.time, self.certain = count, speed, time, certain
        self.jumps, self._take_any = 0.0, False

    def _follow(self, angle: int, speed: float, elapsed: float) -> bool:
        """Move the count to `angle`; False when the rotor cannot have got there."""
        if abs(speed - self.speed) > _SPEED_JUMP + _SPEED_RATE * elapsed:
            return False
        nearest = _wrap(angle - self.count)
        if abs(speed) < _REST_SPEED and abs(self.speed) < _REST_SPEED and abs(nearest) < _REST_ANGLE:
            self.count += round(nearest)
            return True
        predicted = 0.5 * (speed + self.speed) * _COUNTS_PER_S * elapsed
        reach = (elapsed + _TIME_UNCERTAINTY) * _COUNTS_PER_S
        room = _TOLERANCE + 0.25 * _ACCELERATION * elapsed * elapsed
        low, high = min(0.0, speed, self.speed) * reach - room, max(0.0, speed, self.speed) * reach + room
        first = low + (angle - self.count - low) % COUNTS_PER_TURN
        if first > high:
            return False
        turned = predicted + _wrap(angle - self.count - predicted)
        if not low <= turned <= high:
            turned = first
        self.certain = self.certain and first + COUNTS_PER_TURN > high
        self.count += round(turned)
        return True

    def _reject(self) -> bool:
        self.jumps += 1
        self.rejected += 1
        return False


def _wrap(counts: float) -> float:
    """Into [-4096, 4096)."""
    return (counts + COUNTS_PER_TURN // 2) % COUNTS_PER_TURN - COUNTS_PER_TURN // 2
