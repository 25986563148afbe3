"""Temperature control of the IMU: target, PID once per reading of the chip, ready flag, and faults that switch the heater off.

The chip renews its reading only every 1.28 s. The loop runs once per renewal, not on the repetitions in between. The target is
fixed, or `rise` above the ambient temperature, which is the first reading of the cold chip. The ambient is learned once and
limited to `warmest_ambient`: after a restart the chip is still warm, and without the limit the target would rise with each
restart. The faults "dead heater" and "over temperature" stay until `reset`; "dead sensor" and "bad reading" end with the next
valid reading.
"""

import math
from dataclasses import dataclass, field
from enum import Enum

from gravcomp.config import parameter
from gravcomp.thermal.pid import Pid, PidOptions
from gravcomp.thermal.plant import READING_PERIOD, READING_STEP


@dataclass(frozen=True)
class HeaterOptions:
    """Options of the temperature control."""

    enabled: bool = parameter(True, description="use the heater")
    rise: float = parameter(
        15.0, unit="degC", minimum=0, maximum=60, description="target above the ambient, when no target is given"
    )
    target: float | None = parameter(
        None, unit="degC", minimum=0, maximum=65, description="fixed target; none: ambient plus rise"
    )
    ambient: float | None = parameter(None, unit="degC", minimum=-40, maximum=60, description="ambient; none: the first reading")
    warmest_ambient: float = parameter(
        30.0,
        unit="degC",
        minimum=0,
        maximum=60,
        description="largest ambient that is learned; a first reading above it comes from a chip that is still warm",
    )
    highest_target: float = parameter(60.0, unit="degC", minimum=0, maximum=65, description="a higher target is limited to this")
    over_temperature: float = parameter(
        70.0, unit="degC", minimum=20, maximum=105, description="at this temperature the heater is switched off until reset"
    )
    largest_excess: float = parameter(
        15.0, unit="degC", minimum=3, maximum=60, description="this far above the target the heater is switched off until reset"
    )
    margin: float = parameter(
        0.5, unit="degC", minimum=0.1, maximum=10, description="largest deviation from the target when ready"
    )
    ready_time: float = parameter(5.0, unit="s", minimum=0, maximum=600, description="ready after this time within the margin")
    sensor_timeout: float = parameter(
        5.0, unit="s", minimum=1.5, maximum=60, description="fault after this time without a reading: the sensor is dead"
    )
    dead_time: float = parameter(
        30.0,
        unit="s",
        minimum=5,
        maximum=600,
        description="fault after this time at nearly full duty without warming: the heater is dead",
    )
    dead_rise: float = parameter(
        1.0, unit="degC", minimum=0.125, maximum=20, description="temperature rise that is required in this time"
    )
    pid: PidOptions = field(default_factory=PidOptions)


class HeaterFault(Enum):
    """Fault that switches the heater off; the value is shown to the user."""

    NONE = ""
    OVER_TEMPERATURE = "over temperature: the chip is much too warm"
    DEAD_HEATER = "the heater is fully on and the reading does not rise: the heater is dead or too weak, or the reading is stuck"
    DEAD_SENSOR = "no temperature reading arrives"
    BAD_READING = "the temperature reading is not finite or out of range"


PASSING = frozenset({HeaterFault.DEAD_SENSOR, HeaterFault.BAD_READING})
"""Faults that end with the next valid reading."""

PLAUSIBLE = (-45.0, 130.0)
"""degC; range of the BMI088's readings."""

NEARLY_FULL = 0.9
"""Share of the largest duty above which the chip must warm; at a smaller duty it may be in balance with the ambient."""


@dataclass(frozen=True, slots=True)
class HeaterState:
    """State of the control after a reading or a check."""

    duty: float  # 0..1
    target: float  # degC, NaN before the first reading
    temperature: float  # degC, NaN before the first reading
    ready: bool
    fault: HeaterFault


class HeaterControl:
    """Computes the duty from stamped temperature readings; `check` detects that no more readings come.

    Attribute `ambient` (degC): the learned one, None before the first reading. The argument is one that an earlier control of
    the same chip has learned.
    """

    def __init__(self, options: HeaterOptions | None = None, ambient: float | None = None):
        self.options = options or HeaterOptions()
        self.ambient = ambient
        self._pid = Pid(self.options.pid)
        self.reset()

    def reset(self) -> None:
        """Forget faults, target and history, but not the learned ambient."""
        self._pid.reset()
        self._target = math.nan
        self._temperature = math.nan
        self._duty = 0.0
        self._fault = HeaterFault.NONE
        self._last_ns: int | None = None
        self._controlled_ns: int | None = None
        self._within_since_ns: int | None = None
        self._full_since_ns: int | None = None
        self._full_from = math.nan
        self._ready = False

    @property
    def state(self) -> HeaterState:
        """Present state of the control."""
        return HeaterState(self._duty, self._target, self._temperature, self._ready, self._fault)

    def update(self, stamp_ns: int, temperature: float) -> HeaterState:
        """Take a reading (degC) with its stamp, and return the new state. Repetitions between renewals are allowed."""
        if not math.isfinite(temperature) or not PLAUSIBLE[0] <= temperature <= PLAUSIBLE[1]:
            return self._fail(HeaterFault.BAD_READING)
        if self._last_ns is not None and stamp_ns <= self._last_ns:
            return self.state
        self._last_ns = stamp_ns
        if self._fault in PASSING:
            self._fault = HeaterFault.NONE
        renewed = math.isnan(self._temperature) or abs(temperature - self._temperature) >= 0.5 * READING_STEP
        self._temperature = temperature
        if math.isnan(self._target):
            self._target = self._choose_target(temperature)
        if temperature >= min(self.options.over_temperature, self._target + self.options.largest_excess):
            return self._fail(HeaterFault.OVER_TEMPERATURE)
        if self._fault is not HeaterFault.NONE or not self.options.enabled:
            self._watch_ready(stamp_ns)
            return self.state

        since = READING_PERIOD if self._controlled_ns is None else (stamp_ns - self._controlled_ns) * 1e-9
        # A reading that does not change counts as renewed after the period of the chip.
        if renewed or since >= READING_PERIOD:
            self._controlled_ns = stamp_ns
            self._duty = self._pid.update(min(since, 2.0 * READING_PERIOD), self._target, temperature)
            self._watch_heater(stamp_ns)
        self._watch_ready(stamp_ns)
        return self.state

    def check(self, stamp_ns: int) -> HeaterState:
        """Check at time `stamp_ns` whether readings still come, and return the new state."""
        if self._last_ns is None:
            self._last_ns = stamp_ns
        elif (stamp_ns - self._last_ns) * 1e-9 > self.options.sensor_timeout and self._fault is HeaterFault.NONE:
            return self._fail(HeaterFault.DEAD_SENSOR)
        return self.state

    def _choose_target(self, first: float) -> float:
        options = self.options
        if options.target is not None:
            return min(options.target, options.highest_target)
        if self.ambient is None:
            self.ambient = min(first, options.warmest_ambient)
        ambient = self.ambient if options.ambient is None else options.ambient
        return min(ambient + options.rise, options.highest_target)

    def _watch_heater(self, stamp_ns: int) -> None:
        if self._duty < NEARLY_FULL * self.options.pid.highest:
            self._full_since_ns = None
            return
        if self._full_since_ns is None:
            self._full_since_ns, self._full_from = stamp_ns, self._temperature
        elif (stamp_ns - self._full_since_ns) * 1e-9 >= self.options.dead_time:
            if self._temperature - self._full_from < self.options.dead_rise:
                self._fail(HeaterFault.DEAD_HEATER)
            self._full_since_ns, self._full_from = stamp_ns, self._temperature

    def _watch_ready(self, stamp_ns: int) -> None:
        if abs(self._temperature - self._target) > self.options.margin:
            self._within_since_ns = None
        elif self._within_since_ns is None:
            self._within_since_ns = stamp_ns
        self._ready = (
            self._fault is HeaterFault.NONE
            and self._within_since_ns is not None
            and (stamp_ns - self._within_since_ns) * 1e-9 >= self.options.ready_time
        )

    def _fail(self, fault: HeaterFault) -> HeaterState:
        if self._fault is HeaterFault.NONE:
            self._fault = fault
        self._duty = 0.0
        self._ready = False
        return self.state
