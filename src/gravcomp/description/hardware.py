"""The section `hardware:` of a robot's YAML: the CAN bus and the motors as data.

    hardware:
      can: {interface: socketcan, channel: can0}
      drive: {capstan_radius_mm: 5, ...}           # alike for every motor
      motors:
        - {cable: s1c1, can_id: 1, direction: 1}

Cable displacement [m] is positive when pulled in:  displacement = direction x rotor turns / gear_ratio x 2 pi capstan_radius.
"""

import dataclasses
import math
from typing import Any

from gravcomp.config import ConfigError, from_mapping, parameter

COUNTS_PER_TURN = 8192
"""Of the C610's rotor angle, 0..8191."""

MOTOR_IDS = range(1, 9)
"""CAN ids that a C610 can be set to."""


@dataclasses.dataclass(frozen=True)
class CanInterface:
    """A bus by python-can's interface and channel."""

    interface: str = parameter(
        "udp_multicast",
        description="python-can interface: udp_multicast (virtual robot), socketcan, slcan, pcan, ...",
        read_only=True,
    )
    channel: str = parameter(
        "239.74.163.2:43113", description="its channel: can0, /dev/ttyACM0, or multicast group:port", read_only=True
    )
    bitrate: int = parameter(
        1_000_000, unit="bit/s", minimum=10_000, maximum=1_000_000, description="where the interface sets it", read_only=True
    )
    hop_limit: int = parameter(
        0, minimum=0, maximum=255, description="of udp_multicast; 0: no frame leaves this host", read_only=True
    )


@dataclasses.dataclass(frozen=True)
class Drive:
    """What all motors, gears, capstans and their position loops have in common."""

    gear_ratio: float = parameter(36.0, minimum=1, maximum=1000, description="rotor turns a turn of the capstan (M2006: 36)")
    capstan_radius: float = parameter(5.0, edge="mm", minimum=0.5, maximum=50, description="to the middle of the cable")
    torque_constant: float = parameter(0.18, unit="N m/A", minimum=1e-3, maximum=10, description="at the gear's output")
    current_limit: float = parameter(1.0, unit="A", minimum=0.05, maximum=10, description="no current frame ever asks for more")
    tension_limit: float = parameter(5.0, unit="N", minimum=0, maximum=100, description="of the feed-forward")
    pretension: float = parameter(0.0, unit="N", minimum=0, maximum=20, description="least feed-forward of tension")
    velocity_limit: float = parameter(40.0, edge="mm/s", minimum=0.1, maximum=250, description="of the cable")
    acceleration_limit: float = parameter(0.2, unit="m/s^2", minimum=0.01, maximum=50, description="of the cable's setpoint")
    displacement_minimum: float = parameter(-30.0, edge="mm", minimum=-200, maximum=0, description="farthest paid out")
    displacement_maximum: float = parameter(30.0, edge="mm", minimum=0, maximum=200, description="farthest pulled in")
    position_gain: float = parameter(
        25.0, unit="1/s", minimum=0.1, maximum=200, description="velocity asked for a metre of error"
    )
    velocity_gain: float = parameter(90.0, unit="A s/m", minimum=0.1, maximum=5000, description="current for velocity error")
    velocity_integral: float = parameter(
        1500.0, unit="A/m", minimum=0, maximum=1e5, description="current for integrated velocity error; overcomes friction"
    )

    @property
    def travel_per_count(self) -> float:
        """m of cable a count of the rotor's angle."""
        return 2 * math.pi * self.capstan_radius / (self.gear_ratio * COUNTS_PER_TURN)

    @property
    def tension_per_ampere(self) -> float:
        """N a A, without friction."""
        return self.torque_constant / self.capstan_radius


@dataclasses.dataclass(frozen=True)
class Motor:
    """One motor and its cable."""

    cable: str = parameter(description="name of the cable as under robot.cables")
    can_id: int = parameter(minimum=1, maximum=8, description="as set on the C610")
    direction: int = parameter(1, choices=(1, -1), description="1: the rotor's positive sense pulls the cable in")
    offset: float = parameter(
        0.0, edge="mm", minimum=-20, maximum=20, description="displacement of the cable at the motor's zero, as calibrated"
    )


@dataclasses.dataclass(frozen=True)
class Homing:
    """How the zero of each cable is found, see gravcomp.motors.homing."""

    velocity: float = parameter(4.0, edge="mm/s", minimum=0.1, maximum=50, description="of winding in")
    current_rise: float = parameter(
        0.06, unit="A", minimum=0.005, maximum=5, description="above the running current of the slack cable: it is taut"
    )
    travel_limit: float = parameter(30.0, edge="mm", minimum=1, maximum=300, description="winding in farther than this fails")
    slack: float = parameter(5.0, edge="mm", minimum=0.5, maximum=20, description="let out first, so that the slack is felt")


@dataclasses.dataclass(frozen=True)
class Watchdog:
    """After what time what is missing counts as gone, and what counts as a fault of a motor."""

    command_timeout: float = parameter(
        200.0,
        edge="ms",
        minimum=20,
        maximum=5000,
        description="without cable/command caused by an IMU sample younger than this: hold",
    )
    command_jump: float = parameter(5.0, edge="mm", minimum=0.1, maximum=100, description="between two commands; more is refused")
    imu_timeout: float = parameter(150.0, edge="ms", minimum=20, maximum=5000, description="without IMU samples: hold")
    feedback_timeout: float = parameter(
        100.0, edge="ms", minimum=5, maximum=1000, description="without a motor's feedback: fault"
    )
    zero_timeout: float = parameter(
        1000.0, edge="ms", minimum=100, maximum=60000, description="without feedback: the count of turns is lost"
    )
    stall_time: float = parameter(180.0, edge="ms", minimum=20, maximum=5000, description="at the current limit without motion")
    following_error: float = parameter(6.0, edge="mm", minimum=0.1, maximum=100, description="behind the setpoint: runaway")
    overspeed: float = parameter(2.0, minimum=1.2, maximum=10, description="times the velocity limit: runaway")


@dataclasses.dataclass(frozen=True)
class Hardware:
    """The bus, the motors in the order of the cables, and how they are watched."""

    motors: tuple[Motor, ...] = parameter(description="one a cable, in the order of robot.cables")
    can: CanInterface = dataclasses.field(default_factory=CanInterface)
    drive: Drive = dataclasses.field(default_factory=Drive)
    homing: Homing = dataclasses.field(default_factory=Homing)
    watchdog: Watchdog = dataclasses.field(default_factory=Watchdog)

    def __post_init__(self) -> None:
        if not 1 <= len(self.motors) <= len(MOTOR_IDS):
            raise ValueError(f"{len(self.motors)} motors; allowed: 1 to {len(MOTOR_IDS)}")
        for what, values in (("can_id", [m.can_id for m in self.motors]), ("cable", [m.cable for m in self.motors])):
            twice = sorted({str(v) for v in values if values.count(v) > 1})
            if twice:
                raise ValueError(f"{what} {', '.join(twice)} is given to more than one motor")

    @property
    def cables(self) -> tuple[str, ...]:
        return tuple(motor.cable for motor in self.motors)


def parse_hardware(section: Any, *, source: str, cables: tuple[str, ...] | None = None) -> Hardware:
    """The section as data. Raises ConfigError; also when `cables` (the robot's, in order) are not those of the motors."""
    hardware = from_mapping(Hardware, section, source=source, key="hardware")
    if cables is not None and hardware.cables != tuple(cables):
        raise ConfigError(
            f"{source}: hardware.motors are for the cables {', '.join(hardware.cables)}; "
            f"needed, in this order: {', '.join(cables)}"
        )
    return hardware
