"""Setup of an experiment: the robot in the model of the controller, and the virtual robot in place of the real one."""

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import Any

from gravcomp.config import from_mapping
from gravcomp.description import Robot, RobotFile
from gravcomp.description.hardware import Hardware
from gravcomp.graph.parameters.fem_simulator import FemSimulatorParameters
from gravcomp.graph.parameters.imu_estimator import ImuEstimatorParameters
from gravcomp.graph.parameters.inverse_controller import InverseControllerParameters
from gravcomp.inverse import direction_weight
from gravcomp.orientation.imu_calibration import ImuCalibration
from gravcomp.scene.scene import Scene
from gravcomp.virtual.body import build_rod, first_frequency
from gravcomp.virtual.described import described
from gravcomp.virtual.draw import draw
from gravcomp.virtual.parameters import VirtualRobotParameters
from gravcomp.virtual.true_robot import TrueRobot


@dataclass(frozen=True)
class Setup:
    """Model and virtual robot of one robot.

    robot, hardware: in model, controller and bridge, with assumed lines where none are described; nominal, nominal_hardware: the
    description from which the virtual robot is built, with what is given in `truth` and what `seed` draws. Otherwise they are
    equal (hardware: None) unless a calibration changes robot and hardware.
    """

    source: str
    robot: Robot
    nominal: Robot
    truth: VirtualRobotParameters
    hardware: Hardware
    estimator: ImuEstimatorParameters
    simulator: FemSimulatorParameters
    controller: InverseControllerParameters
    seed: int
    nominal_hardware: Hardware | None = None
    scene: Scene | None = None  # around the virtual robot
    modelled_scene: Scene | None = None  # in the model, fixed to its base or to the world's axes
    zones: Scene | None = None  # forbidden

    @classmethod
    def of(cls, file: RobotFile, seed: int | None = None) -> "Setup":
        """Return the setup of a robot file; seed: of the virtual robot, default: that of the file. Raises ConfigError."""

        def section(kind: type, name: str) -> Any:
            return from_mapping(kind, file.section("nodes").get(name), source=file.source, key=f"nodes.{name}")

        virtual = described(file, seed)
        hardware = file.hardware
        return cls(
            source=file.source,
            robot=file.robot.with_assumed_lines(),
            nominal=virtual.robot,
            truth=virtual.given,
            hardware=hardware,
            estimator=section(ImuEstimatorParameters, "imu_estimator"),
            simulator=section(FemSimulatorParameters, "fem_simulator"),
            controller=section(InverseControllerParameters, "inverse_controller"),
            seed=virtual.seed,
            nominal_hardware=None if virtual.robot is file.robot else virtual.hardware,
            scene=file.scene or None,
            modelled_scene=file.scene or None,
            zones=file.zones or None,
        )

    @property
    def direction_weight(self) -> float:
        """Weight of the tip's direction in m^2, of the controller or of the robot's size."""
        return direction_weight(self.robot.length, self.controller.tip_direction_weight)

    @property
    def virtual_hardware(self) -> Hardware:
        """Motors of the virtual robot, as described."""
        return self.nominal_hardware or self.hardware

    @functools.cached_property
    def true_robot(self) -> TrueRobot:
        """The virtual robot as it truly is. Raises ConfigError where `truth` describes no robot."""
        return draw(self.truth, self.nominal, self.virtual_hardware, self.seed, f"{self.source}: virtual_robot")

    @functools.cached_property
    def first_period(self) -> float:
        """Period in s of the virtual robot's first bending motion."""
        return 2.0 * math.pi / first_frequency(build_rod(self.true_robot))

    def with_model(self, robot: Robot, hardware: Hardware | None = None, imu: ImuCalibration | None = None) -> "Setup":
        """Return the same virtual robot with another model; with the motor offsets of `hardware` and with `imu`, where given."""
        return dataclasses.replace(
            self,
            robot=robot,
            hardware=hardware or self.hardware,
            nominal_hardware=self.virtual_hardware,
            estimator=self.estimator if imu is None else dataclasses.replace(self.estimator, calibration=imu),
        )
