"""What an experiment works with: the robot as the controller believes it to be, and the virtual robot that stands for the real one."""

import dataclasses
from dataclasses import dataclass
from typing import Any

from gravcomp.config import from_mapping
from gravcomp.description import Robot, RobotFile
from gravcomp.description.hardware import Hardware, parse_hardware
from gravcomp.graph.parameters.imu_estimator import ImuEstimatorParameters
from gravcomp.graph.parameters.inverse_controller import InverseControllerParameters
from gravcomp.virtual.parameters import VirtualRobotParameters


@dataclass(frozen=True)
class Setup:
    """One robot with both its sides.

    robot: what model and controller know; nominal: the shape that the virtual robot is built from (its deviations stand in `truth`);
    both are the same until a calibration or another geometry changes them.
    """

    source: str
    robot: Robot
    nominal: Robot
    truth: VirtualRobotParameters
    hardware: Hardware
    estimator: ImuEstimatorParameters
    controller: InverseControllerParameters
    seed: int

    @classmethod
    def of(cls, file: RobotFile, seed: int | None = None) -> "Setup":
        """The setup that a robot's file describes. Raises ConfigError."""

        def section(kind: type, name: str) -> Any:
            return from_mapping(kind, file.section("nodes").get(name), source=file.source, key=f"nodes.{name}")

        truth = from_mapping(VirtualRobotParameters, file.section("virtual_robot"), source=file.source, key="virtual_robot")
        hardware = parse_hardware(file.section("hardware"), source=file.source, cables=file.robot.cable_names)
        return cls(
            source=file.source,
            robot=file.robot,
            nominal=file.robot,
            truth=truth,
            hardware=hardware,
            estimator=section(ImuEstimatorParameters, "imu_estimator"),
            controller=section(InverseControllerParameters, "inverse_controller"),
            seed=truth.seed if seed is None else seed,
        )

    def believing(self, robot: Robot, hardware: Hardware | None = None) -> "Setup":
        """The same virtual robot under a controller that knows `robot` (and the motors' offsets of `hardware`)."""
        return dataclasses.replace(self, robot=robot, hardware=hardware or self.hardware)

    def with_geometry(self, robot: Robot) -> "Setup":
        """Model and virtual robot both of another geometry, the same materials and deviations."""
        return dataclasses.replace(self, robot=robot, nominal=robot)
