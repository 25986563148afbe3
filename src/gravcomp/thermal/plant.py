"""Thermal plant of a heated IMU: first-order heating, the ambient, and the chip's coarse reading.

    tau dT/dt = T_ambient + rise duty - T,    solved exactly over a step with constant duty.

The BMI088's temperature reading has 0.125 degC per count and is renewed every 1.28 s.
"""

import math
from dataclasses import dataclass

from gravcomp.config import parameter

READING_STEP = 0.125  # degC, BMI088
READING_PERIOD = 1.28  # s, BMI088


@dataclass(frozen=True)
class ThermalPlantOptions:
    """Thermal properties of the board and its surroundings."""

    ambient: float = parameter(20.0, unit="degC", minimum=-40, maximum=85, description="temperature of the surroundings")
    rise: float = parameter(45.0, unit="degC", minimum=1, maximum=200, description="steady rise above the ambient at full duty")
    time_constant: float = parameter(60.0, unit="s", minimum=1, maximum=3600, description="time constant of heating and cooling")
    start: float | None = parameter(
        None, unit="degC", minimum=-40, maximum=120, description="temperature at the start; none: the ambient"
    )


class ThermalPlant:
    """Temperature of the chip under a heater duty, and its reading. Attribute: temperature (degC)."""

    def __init__(self, options: ThermalPlantOptions | None = None):
        self.options = options or ThermalPlantOptions()
        self.temperature = self.options.ambient if self.options.start is None else self.options.start
        self._since_reading = 0.0
        self._reading = quantised(self.temperature)

    @property
    def reading(self) -> float:
        """Reading of the chip (degC)."""
        return self._reading

    def step(self, dt: float, duty: float) -> float:
        """Advance by `dt` (s) with the heater's duty (clamped to 0..1). Return the true temperature (degC)."""
        options = self.options
        final = options.ambient + options.rise * min(max(duty, 0.0), 1.0)
        self.temperature = final + (self.temperature - final) * math.exp(-dt / options.time_constant)
        self._since_reading += dt
        if self._since_reading >= READING_PERIOD:
            self._since_reading %= READING_PERIOD
            self._reading = quantised(self.temperature)
        return self.temperature


def quantised(temperature: float) -> float:
    """Round a temperature (degC) to whole counts of the chip."""
    return round(temperature / READING_STEP) * READING_STEP
