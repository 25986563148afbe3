"""PID controller for measurements at uneven intervals.

    u = Kp e + I - Kd dy/dt,    dI/dt = Kp/Ti e

The derivative acts on the measurement, so a new target gives no kick. The output is limited. The integral is frozen while the
limit is active and the error would drive it further (conditional integration), so it does not wind up.
"""

from dataclasses import dataclass

from gravcomp.config import parameter


@dataclass(frozen=True)
class PidOptions:
    """Gains and output limits; the defaults suit a heater duty against degC."""

    gain: float = parameter(0.25, unit="1/degC", minimum=0, maximum=10, description="duty per degree of error")
    integral_time: float = parameter(40.0, unit="s", minimum=0.1, maximum=10000, description="time constant of the integral part")
    derivative_time: float = parameter(
        0.0,
        unit="s",
        minimum=0,
        maximum=1000,
        description="time constant of the derivative part; 0, as it is of no use on a first-order plant",
    )
    lowest: float = parameter(0.0, minimum=0, maximum=1, description="smallest duty")
    highest: float = parameter(1.0, minimum=0, maximum=1, description="largest duty")

    def __post_init__(self) -> None:
        if not self.lowest < self.highest:
            raise ValueError(f"lowest is {self.lowest:g}; allowed: below highest = {self.highest:g}")


class Pid:
    """One control loop. Attribute: integral."""

    def __init__(self, options: PidOptions | None = None):
        self.options = options or PidOptions()
        self.reset()

    def reset(self) -> None:
        """Forget the integral and the last measurement."""
        self.integral = 0.0
        self._last: float | None = None

    def update(self, dt: float, target: float, measured: float) -> float:
        """Return the output for a measurement that comes `dt` (s) after the last one."""
        options = self.options
        error = target - measured
        slope = 0.0 if self._last is None or dt <= 0.0 else (measured - self._last) / dt
        self._last = measured
        free = options.gain * (error - options.derivative_time * slope)
        integral = self.integral + options.gain / options.integral_time * error * dt
        wanted = free + integral
        output = min(max(wanted, options.lowest), options.highest)
        driven_further = (wanted - output) * error > 0.0
        if not driven_further:
            self.integral = integral
        return output
