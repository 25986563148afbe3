"""Setup of an experiment: the robot in the model of the controller, and the virtual robot in place of the real one."""

import dataclasses
from dataclasses import dataclass
from typing import Any

from gravcomp.config import from_mapping
from gravcomp.description import Robot, RobotFile
from gravcomp.description.hardware import Hardware, parse_hardware
from gravcomp.description.pairs import check_pairs
from gravcomp.graph.parameters.imu_estimator import ImuEstimatorParameters
from gravcomp.graph.parameters.inverse_controller import InverseControllerParameters
from gravcomp.virtual.parameters import VirtualRobotParameters


@dataclass(frozen=True)
class Setup:
    """Model and virtual robot of one robot.

    robot: the robot in model and controller; nominal: the robot from which the virtual robot is built, with the deviations in
    `truth`. Both are equal unless a calibration changes `robot`.
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
        """Return the setup of a robot file; seed: of the virtual robot, default: that of the file. Raises ConfigError."""

        def section(kind: type, name: str) -> Any:
            return from_mapping(kind, file.section("nodes").get(name), source=file.source, key=f"nodes.{name}")

        truth = from_mapping(VirtualRobotParameters, file.section("virtual_robot"), source=file.source, key="virtual_robot")
        hardware = parse_hardware(file.section("hardware"), source=file.source, cables=file.robot.cable_names)
        check_pairs(hardware, file.robot, file.source)
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

    def with_model(self, robot: Robot, hardware: Hardware | None = None) -> "Setup":
        """Return the same virtual robot with another model, and with the motor offsets of `hardware` where it is given."""
        return dataclasses.replace(self, robot=robot, hardware=hardware or self.hardware)
