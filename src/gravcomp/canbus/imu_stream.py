"""IMU samples from the board's frames: assembled, checked for gaps, repeats and order, and stamped by the board's clock.

A frame arrives late by the delays of bus, driver and scheduler, never early. So the host time of a sample is the board's time
plus the smallest difference seen. That difference may grow slowly, to follow clocks that drift apart:

    offset(k) = min(offset(k-1) + DRIFT x (t_k - t_(k-1)), reception(k) - t_k),    stamp(k) = t_k + offset(k) <= reception(k)

When all samples of a window are later than that by more than STEP, one of the clocks was set or stopped: the offset follows
immediately.
"""

import dataclasses
import math
from typing import Any, NamedTuple

import can

from gravcomp.canbus import codec
from gravcomp.canbus.imu_scales import accelerometer_scale, gyroscope_scale, known_ranges

DRIFT = 2e-4
"""Growth of the offset, s/s: more than the difference of two crystals (2 x 50 ppm); 2 us per sample."""

STEP, STEP_WINDOW = 0.02, 5
"""Delay (s) of all samples in a window (number of samples) after which the offset follows."""

STUCK_SAMPLES = 10
"""Equal or saturated samples in a row that are a fault: the BMI088's noise is at least a count on six axes."""

IMU_FRAMES = (0x310, 0x311, 0x312, 0x313)
_FULL_SCALE = 32767  # counts
_WRAP = 1 << 32  # us
_SET_BACK = 1.0  # s; stamps that go back by more mean that the host's clock was set back
_RESTART = 1_000_000  # us; a board time that goes back by more, or ahead of the reception by more, means a restart of the board


class ImuSample(NamedTuple):
    """One IMU sample, along the sensor's axes."""

    stamp: float  # s, host clock
    reception: float  # s, host clock
    sequence: int
    board_time: int  # us, wraps
    specific_force: tuple[float, float, float]  # m/s^2
    angular_rate: tuple[float, float, float]  # rad/s
    temperature: float  # degC


@dataclasses.dataclass
class ImuCounters:
    """Counters since the stream began."""

    samples: int = 0
    lost: int = 0  # from the gaps of the sequence
    repeated: int = 0  # same or older board time
    rejected: int = 0  # wrong length or check
    restarts: int = 0  # of the board


class BoardClock:
    """Maps the board's time (us) to the host's clock."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the offset, as after a restart of the board."""
        self._offset = math.inf
        self._time: float | None = None  # s, unwrapped
        self._last_us = 0
        self._last_stamp = -math.inf
        self._least_delay, self._window = math.inf, 0

    def advance(self, board_time: int) -> int:
        """Return the time since the last sample (us, modulo the wrap); negative for an older sample, 0 for the first one."""
        if self._time is None:
            return 0
        return (board_time - self._last_us + _WRAP // 2) % _WRAP - _WRAP // 2

    def stamp(self, board_time: int, reception: float) -> float:
        """Return the host time (s) of a sample that was received at `reception` (s).

        It increases strictly unless the host's clock was set back.
        """
        elapsed = 1e-6 * self.advance(board_time)
        self._time = 1e-6 * board_time if self._time is None else self._time + elapsed
        self._last_us = board_time
        self._offset = min(self._offset + DRIFT * elapsed, reception - self._time)
        self._follow_step(reception - self._time - self._offset)
        stamp = self._time + self._offset
        if stamp > self._last_stamp - _SET_BACK:
            stamp = max(stamp, self._last_stamp + 1e-6)
        self._last_stamp = stamp
        return stamp

    def _follow_step(self, delay: float) -> None:
        self._least_delay, self._window = min(self._least_delay, delay), self._window + 1
        if self._window == STEP_WINDOW:
            if self._least_delay > STEP:
                self._offset += self._least_delay
            self._least_delay, self._window = math.inf, 0


class ImuStream:
    """Makes samples from the board's frames.

    Attributes: counters, status (values of the last BoardStatus, or None), stuck, saturated.
    """

    def __init__(self) -> None:
        self.counters = ImuCounters()
        self.status: Any = None
        self.stuck = self.saturated = False
        self._parts: dict[str, Any] = {}
        self._sequence: int | None = None
        self._clock = BoardClock()
        self._last_reception = -math.inf
        self._last_raw: tuple | None = None
        self._equal = self._saturated_samples = 0

    @property
    def fault(self) -> str | None:
        """Reason why the samples must not be used, in one sentence; None without a fault."""
        if self.status is None:
            return "the board has not sent its status yet"
        if self.status.protocol != codec.PROTOCOL:
            return f"the board uses version {self.status.protocol} of the frames; {codec.PROTOCOL} is needed: update its firmware"
        if int(self.status.flags) & 1:
            return "the board's IMU does not answer"
        if self.stuck:
            return "the IMU repeats the same sample"
        if self.saturated:
            return "the IMU is saturated"
        return None

    def on_frame(self, message: can.Message, reception: float) -> ImuSample | None:
        """Take a frame received at `reception` (s, host clock). Return the sample that it completes, or None."""
        if message.arbitration_id not in IMU_FRAMES:
            return None
        try:
            name, values = codec.decode(message)
        except codec.FrameError:
            self.counters.rejected += 1
            return None
        if name == "BoardStatus":
            if known_ranges(values.accelerometer_range, values.gyroscope_range):
                self.status = values
            return None
        self._parts[name] = values
        if name != "ImuTime":
            return None
        acceleration, rate = self._parts.get("ImuAccelerometer"), self._parts.get("ImuGyroscope")
        if acceleration is None or rate is None or not acceleration.sequence == rate.sequence == values.sequence:
            return None
        return self._sample(acceleration, rate, values, reception)

    def _sample(self, acceleration: Any, rate: Any, time: Any, reception: float) -> ImuSample | None:
        if self.status is None:  # without the ranges the counts cannot be converted
            return None
        advance = self._clock.advance(time.time)
        if abs(advance) > _RESTART + 1e6 * max(0.0, reception - self._last_reception) or advance < -_RESTART:
            self.counters.restarts += 1
            self._clock.reset()
            self._sequence = None
        elif self._sequence is not None and advance <= 0:
            self.counters.repeated += 1
            return None
        if self._sequence is not None:
            self.counters.lost += (time.sequence - self._sequence - 1) % 256
        self._sequence, self._last_reception = time.sequence, reception
        raw = (*acceleration[:3], *rate[:3])
        self._equal = self._equal + 1 if raw == self._last_raw else 0
        self._last_raw, self.stuck = raw, self._equal >= STUCK_SAMPLES
        beyond = max(raw) >= _FULL_SCALE or min(raw) <= -_FULL_SCALE
        self._saturated_samples = self._saturated_samples + 1 if beyond else 0
        self.saturated = self._saturated_samples >= STUCK_SAMPLES
        self.counters.samples += 1
        a, g = accelerometer_scale(int(self.status.accelerometer_range)), gyroscope_scale(int(self.status.gyroscope_range))
        return ImuSample(
            stamp=self._clock.stamp(time.time, reception),
            reception=reception,
            sequence=time.sequence,
            board_time=time.time,
            specific_force=(acceleration.x * a, acceleration.y * a, acceleration.z * a),
            angular_rate=(rate.x * g, rate.y * g, rate.z * g),
            temperature=time.temperature,
        )
