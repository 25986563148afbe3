"""How the motors are driven, the same for all of them: drive, homing, watchdog (`hardware.drive`, `.homing`, `.watchdog`)."""

import dataclasses
import math

from gravcomp.config import parameter

COUNTS_PER_TURN = 8192
"""Counts of the C610's rotor angle per turn, 0..8191."""

LEAST_RISE = 0.005
"""Least rise of the current in A by which homing can be told to take a cable as taut."""


@dataclasses.dataclass(frozen=True)
class Drive:
    """Motors, gears, capstans and position loops; the same for every cable."""

    gear_ratio: float = parameter(36.0, minimum=1, maximum=1000, description="rotor turns per turn of the capstan (M2006: 36)")
    capstan_radius: float = parameter(
        5.0,
        edge="mm",
        minimum=0.1,
        maximum=50,
        description="from the axis to the middle of the cable; of a lead screw its lead over 2 pi",
    )
    capstan_assumed: bool = parameter(
        False,
        description="nobody has measured capstan_radius_mm, which suits the virtual robot: real motors are refused",
    )
    backlash: float = parameter(0.6, edge="deg", minimum=0, maximum=90, description="of the gear, at its output")
    take_up_time: float = parameter(
        0.3,
        unit="s",
        minimum=0.0,
        maximum=60.0,
        description="rest of a cable's target after which the motor takes up the backlash: out by it and in again; 0: never",
    )
    torque_constant: float = parameter(0.18, unit="N m/A", minimum=1e-3, maximum=10, description="at the gear's output")
    current_limit: float = parameter(1.0, unit="A", minimum=0.05, maximum=10, description="largest current in a frame")
    tension_limit: float = parameter(5.0, unit="N", minimum=0, maximum=1000, description="largest feed-forward of tension")
    pretension: float = parameter(0.0, unit="N", minimum=0, maximum=20, description="smallest feed-forward of tension")
    velocity_limit: float = parameter(40.0, edge="mm/s", minimum=0.1, maximum=250, description="largest speed of a cable")
    acceleration_limit: float = parameter(
        0.2, unit="m/s^2", minimum=0.01, maximum=50, description="largest acceleration of a cable's setpoint"
    )
    displacement_min: float = parameter(
        -30.0,
        edge="mm",
        minimum=-1000,
        maximum=0,
        description="farthest paid out",
        renamed_from="displacement_minimum_mm",
    )
    displacement_max: float = parameter(
        30.0,
        edge="mm",
        minimum=0,
        maximum=1000,
        description="farthest pulled in",
        renamed_from="displacement_maximum_mm",
    )
    position_gain: float = parameter(
        25.0, unit="1/s", minimum=0.1, maximum=200, description="velocity per metre of position error"
    )
    velocity_gain: float = parameter(90.0, unit="A s/m", minimum=0.1, maximum=5000, description="current per velocity error")
    velocity_integral: float = parameter(
        1500.0, unit="A/m", minimum=0, maximum=1e5, description="current per integrated velocity error; overcomes friction"
    )

    @property
    def travel_per_count(self) -> float:
        """Cable displacement per count of the rotor's angle (m)."""
        return 2 * math.pi * self.capstan_radius / (self.gear_ratio * COUNTS_PER_TURN)

    @property
    def tension_per_ampere(self) -> float:
        """Cable tension per motor current (N/A), without friction."""
        return self.torque_constant / self.capstan_radius


@dataclasses.dataclass(frozen=True)
class Homing:
    """Settings of homing, which finds the zero position of each cable (gravcomp.motors.homing)."""

    velocity: float = parameter(4.0, edge="mm/s", minimum=0.1, maximum=50, description="speed of homing")
    current_rise: float = parameter(
        0.06,
        unit="A",
        minimum=LEAST_RISE,
        maximum=5,
        description="rise above the running current of the slack cable at which the cable is taut",
    )
    travel_limit: float = parameter(
        30.0, edge="mm", minimum=1, maximum=300, description="homing fails when the cable is wound in farther"
    )
    slack: float = parameter(5.0, edge="mm", minimum=0.5, maximum=20, description="paid out first, so that every cable is slack")
    tension_max: float | None = parameter(
        None,
        unit="N",
        minimum=0.001,
        maximum=1000,
        description="homing that would pull a cable more is refused; not given: robot.limits.tension_max",
    )


@dataclasses.dataclass(frozen=True)
class Watchdog:
    """Time-outs, and the thresholds of motor faults."""

    command_timeout: float = parameter(
        200.0,
        edge="ms",
        minimum=20,
        maximum=5000,
        description="hold when no cable/command comes whose IMU sample is younger than this",
    )
    command_jump: float = parameter(
        5.0, edge="mm", minimum=0.1, maximum=100, description="largest change between two commands; a larger one is refused"
    )
    imu_timeout: float = parameter(
        150.0, edge="ms", minimum=20, maximum=5000, description="hold after this time without IMU samples"
    )
    feedback_timeout: float = parameter(
        100.0, edge="ms", minimum=5, maximum=1000, description="fault after this time without a motor's feedback"
    )
    zero_timeout: float = parameter(
        1000.0, edge="ms", minimum=100, maximum=60000, description="the zero position is lost after this time without feedback"
    )
    stall_time: float = parameter(
        180.0, edge="ms", minimum=20, maximum=5000, description="stall: time at the current limit without motion"
    )
    following_error: float = parameter(
        6.0, edge="mm", minimum=0.1, maximum=100, description="runaway: distance from the setpoint"
    )
    overspeed: float = parameter(2.0, minimum=1.2, maximum=10, description="runaway: speed as a multiple of the velocity limit")
