"""Parameters of the orientation filter: one set, in physical units, for all motions and all sample rates.

Noise is given as the root of a spectral density: at the sample period dt a measurement has the variance density^2 / dt, and a
state receives the variance density^2 dt, at any rate.
"""

from dataclasses import dataclass, field

from gravcomp.config import parameter
from gravcomp.orientation.spikes import SpikeOptions


@dataclass(frozen=True)
class RestOptions:
    """Conditions for the sensor to count as at rest."""

    time_constant: float = parameter(
        0.5, unit="s", minimum=0.05, maximum=10, description="of the low-pass from which deviations are measured"
    )
    gyro_deviation: float = parameter(
        2.0, edge="deg/s", minimum=0.01, maximum=100, description="largest deviation of a rate at rest"
    )
    accel_deviation: float = parameter(
        0.5, unit="m/s^2", minimum=0.001, maximum=10, description="largest deviation of a specific force at rest"
    )
    accel_drift: float = parameter(
        0.05,
        unit="m/s^2",
        minimum=0.001,
        maximum=1,
        description="largest drift of the mean specific force since rest began: 0.3 deg of tilt",
    )
    minimum_time: float = parameter(1.5, unit="s", minimum=0.1, maximum=60, description="time for which the conditions must hold")
    largest_bias: float = parameter(
        3.0, edge="deg/s", minimum=0.1, maximum=20, description="a larger mean rate is motion, not bias"
    )


@dataclass(frozen=True)
class SensorOptions:
    """Ranges and timing of the IMU; a sample beyond a range is saturated or has a wrong unit."""

    gyro_range: float = parameter(2000.0, edge="deg/s", minimum=10, maximum=10000, description="full scale of the gyroscope")
    accel_range: float = parameter(235.0, unit="m/s^2", minimum=15, maximum=4000, description="full scale of the accelerometer")
    delay: float = parameter(
        2.5, edge="ms", minimum=0, maximum=50,
        description="group delay of the IMU's own low-pass (about 2 to 3 ms at 116 Hz), compensated with the measured rate",
    )  # fmt: skip
    stuck_time: float = parameter(
        1.0, unit="s", minimum=0.02, maximum=60, description="the same values for this time: the sensor is stuck"
    )
    largest_gap: float = parameter(
        1.1, unit="s", minimum=0.02, maximum=10,
        description="after a longer step between samples the inclination is restarted; the rates before it say nothing of more",
    )  # fmt: skip


@dataclass(frozen=True)
class FilterOptions:
    """Noise of model and sensor, and the conditions of rest."""

    gravity: float = parameter(9.81, unit="m/s^2", minimum=9.7, maximum=9.9, description="local gravity")
    gyro_noise: float = parameter(
        0.01, edge="deg/s", minimum=1e-5, maximum=10, description="noise density of the gyroscope, per sqrt(Hz)"
    )
    gyro_noise_per_rate: float = parameter(
        0.001, unit="sqrt(s)", minimum=0, maximum=1, description="its growth with the rate: scale error and misalignment"
    )
    accel_noise: float = parameter(
        0.01,
        unit="m/s^2/sqrt(Hz)",
        minimum=1e-5,
        maximum=10,
        description="noise density of the accelerometer; that of vibration is measured, and counts where it is more",
    )
    accel_error: float = parameter(
        0.03,
        unit="m/s^2",
        minimum=0,
        maximum=2,
        description="uncertainty of its calibration, part of the reported inclination covariance",
    )
    bias_walk: float = parameter(0.01, edge="deg/s", minimum=0, maximum=1, description="random walk of the bias, per sqrt(s)")
    bias_walk_stable: float = parameter(
        0.001,
        edge="deg/s",
        minimum=0,
        maximum=1,
        description="the same, per sqrt(s), while the temperature is stable",
    )
    bias_initial: float = parameter(
        1.0, edge="deg/s", minimum=0.001, maximum=20, description="standard deviation of the bias at the start"
    )
    velocity_noise: float = parameter(
        0.15,
        unit="m/s sqrt(s)",
        minimum=0.001,
        maximum=100,
        description="density of 'the velocity is about zero': the sensor moves, but stays near one place",
    )
    rest_noise: float = parameter(
        0.05, edge="deg/s", minimum=1e-4, maximum=10, description="density of 'the mean rate at rest is the bias', times sqrt(s)"
    )
    bias_estimation: bool = parameter(True, description="estimate the gyroscope's bias while running")
    rest: RestOptions = field(default_factory=RestOptions)
    sensor: SensorOptions = field(default_factory=SensorOptions)
    spikes: SpikeOptions = field(default_factory=SpikeOptions)
