"""Motors of a ros2_control robot: `hardware.joints` of a robot file.

    hardware:
      joints:
        controller: cable_controller        # topics are CONTROLLER/joint_trajectory or CONTROLLER/commands
        command: trajectory                 # or position, effort
        motors:
          - {cable: s1c1, joint: motor_1, direction: -1, zero_deg: 12.5}
          - {cable: s1c2, joint: motor_2, lookup: {angle_deg: [0, 90, 180], displacement_mm: [0, 8, 15]}}

With the angle q of the joint, its direction d = +-1 and its zero q_0, the displacement at the capstan is

    u = r d (q - q_0) + offset         or, with a lookup,        u = f(d (q - q_0)) + offset.
"""

import dataclasses

from gravcomp.config import parameter
from gravcomp.description.motor import CableMotor

COMMANDS = ("trajectory", "position", "effort")
"""What the controller takes: JointTrajectory, positions or efforts of the forward command controller."""


@dataclasses.dataclass(frozen=True)
class Lookup:
    """A measured capstan: displacement over angle, both strictly increasing; linear in between."""

    angle: tuple[float, ...] = parameter(edge="deg", minimum=-36000, maximum=36000, description="angles from the zero position")
    displacement: tuple[float, ...] = parameter(edge="mm", minimum=-500, maximum=500, description="displacements at these angles")

    def __post_init__(self) -> None:
        if len(self.angle) != len(self.displacement):
            raise ValueError(f"{len(self.angle)} values of angle_deg and {len(self.displacement)} of displacement_mm")
        if len(self.angle) < 2:
            raise ValueError(f"angle_deg has {len(self.angle)} values; needed: two or more")
        for name, values in (("angle_deg", self.angle), ("displacement_mm", self.displacement)):
            if any(after <= before for before, after in zip(values, values[1:])):
                raise ValueError(f"{name} must increase from value to value; `direction` turns the motor round")


@dataclasses.dataclass(frozen=True, kw_only=True)
class JointMotor(CableMotor):
    """A joint that winds cables."""

    joint: str = parameter(description="name of the joint in joint_states and in the controller")
    capstan_radius: float | None = parameter(
        None, edge="mm", minimum=0.1, maximum=200, description="of this motor; not given: hardware.drive.capstan_radius_mm"
    )
    lookup: Lookup | None = parameter(None, description="displacement over angle, in place of a radius")
    zero: float | None = parameter(
        None,
        edge="deg",
        minimum=-36000,
        maximum=36000,
        description="angle of the zero position; not given: the angle at activation",
    )
    angle_min: float | None = parameter(
        None, edge="deg", minimum=-36000, maximum=36000, description="smallest angle of the joint, as in joint_states"
    )
    angle_max: float | None = parameter(
        None, edge="deg", minimum=-36000, maximum=36000, description="largest angle of the joint, as in joint_states"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.lookup is not None and self.capstan_radius is not None:
            raise ValueError(f"{self.label} has capstan_radius_mm and lookup; allowed: one of them")
        low, high = self.angle_min, self.angle_max
        if low is not None and high is not None and low >= high:
            raise ValueError(f"{self.label}: angle_min_deg must be below angle_max_deg")

    @property
    def label(self) -> str:
        """Name of the motor in messages: joint and cables."""
        return f"joint '{self.joint}' ({', '.join(self.ratios)})"


@dataclasses.dataclass(frozen=True)
class Joints:
    """The controller of a ros2_control robot, and the joints that wind cables."""

    controller: str = parameter(description="name of the controller, with its namespace where it is not that of joint_bridge")
    motors: tuple[JointMotor, ...] = parameter(description="joints in the order in which the controller has them")
    command: str = parameter("trajectory", choices=COMMANDS, description="what the controller takes")
    feedback_delay: float | None = parameter(
        None,
        edge="ms",
        minimum=1,
        maximum=200,
        description="command effort: smallest delay of the loops, from a measurement of the joints to the end of the effort that"
        " answers it; not given: what is measured; longer: softer loops",
    )

    def __post_init__(self) -> None:
        if not self.motors:
            raise ValueError("0 motors; allowed: 1 or more")
        names = [motor.joint for motor in self.motors]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"joint {', '.join(twice)} is given to more than one motor")
        for name in (self.controller, *names):
            if not name.strip():
                raise ValueError("the name of a joint or of the controller is empty")

    @property
    def topic(self) -> str:
        """Topic of the commands."""
        return f"{self.controller.rstrip('/')}/{'joint_trajectory' if self.command == 'trajectory' else 'commands'}"
