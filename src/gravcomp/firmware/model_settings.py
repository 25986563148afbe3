"""Settings of the standalone loop from a robot file, in the order of gravcomp_hw/firmware/standalone/settings.h."""

import dataclasses
from typing import Any

import numpy as np

from gravcomp.config import ConfigError, from_mapping
from gravcomp.description import Robot, RobotFile
from gravcomp.description.hardware import MOTOR_IDS, Hardware
from gravcomp.external_loads.base_turn import BaseTurn
from gravcomp.external_loads.options import BaseTurnOptions
from gravcomp.graph.parameters.fem_simulator import FemSimulatorParameters
from gravcomp.graph.parameters.imu_estimator import ImuEstimatorParameters
from gravcomp.graph.parameters.inverse_controller import InverseControllerParameters
from gravcomp.inverse.rest_target import rest_target
from gravcomp.inverse.target import Target, direction_weight
from gravcomp.orientation import quaternion as quat
from gravcomp.scene.scene import Scene

SAMPLE_PERIOD = 0.01  # s, of the board's IMU
CABLES_MAX = 9
"""Room for cables in the firmware (GC_CABLES_MAX)."""
BRANCHES_MAX = 4
"""Room for terms of creep in the firmware (GC_BRANCHES_MAX)."""


@dataclasses.dataclass(frozen=True)
class LoopParameters:
    """What the loop takes from a robot file: `source` is its path."""

    source: str
    robot: Robot
    estimator: ImuEstimatorParameters
    controller: InverseControllerParameters
    hardware: Hardware
    turn: BaseTurnOptions

    @classmethod
    def of(cls, file: RobotFile) -> "LoopParameters":
        """Return the parameters of a robot file. Raises ConfigError."""

        def section(kind: type, name: str) -> Any:
            return from_mapping(kind, file.section("nodes").get(name), source=file.source, key=f"nodes.{name}")

        estimator = section(ImuEstimatorParameters, "imu_estimator")
        controller = section(InverseControllerParameters, "inverse_controller")
        simulator = section(FemSimulatorParameters, "fem_simulator")
        parameters = cls(file.source, file.robot, estimator, controller, file.hardware, simulator.turn)
        parameters.refuse_unknown(file.scene, file.zones, simulator)
        parameters.refuse_too_large()
        return parameters

    def refuse_too_large(self) -> None:
        """Raise ConfigError, with the number, for what is seen in the description: to build the reduced model takes minutes."""
        cables = len(self.robot.cables)
        if cables > min(CABLES_MAX, len(MOTOR_IDS)):
            raise ConfigError(f"{self.source}: has {cables} cables; the bus of the board has room for {len(MOTOR_IDS)} motors")
        materials = [piece.material for piece in self.robot.pieces] or self.robot.materials
        branches = {material.branches for material in materials}
        if len(branches) > 1:
            raise ConfigError(
                f"{self.source}: has {len(branches)} materials that creep differently; the reduced model, and the board, have one"
            )
        terms = max(map(len, branches))
        if terms > BRANCHES_MAX:
            raise ConfigError(f"{self.source}: a material has {terms} terms in prony; the firmware has room for {BRANCHES_MAX}")

    def refuse_unknown(self, scene: Scene | None, zones: Scene | None, simulator: FemSimulatorParameters) -> None:
        """Raise ConfigError for what the loop on the board does not know, and would move the robot against.

        scene: walls of the model; zones: forbidden ones; simulator: that of the host, which may carry or look for a load.
        """
        payload, live, load = self.robot.payload, simulator.payload_mass, simulator.load.kind
        unknown = {
            f"the walls of scene ({', '.join(scene.names) if scene else ''})": scene is not None and bool(scene.walls),
            "scene.self_contact": scene is not None and scene.self_contact,
            f"the forbidden zones of scene ({', '.join(zones.names) if zones else ''})": bool(zones),
            "inverse.max_contact_force": self.controller.inverse.max_contact_force is not None,
            "robot.payload.centre_mm (it has a payload's weight at the tip itself)": payload.mass > 0.0 and any(payload.centre),
            "fem_simulator.payload_mass_g (it has robot.payload)": live >= 0.0 and live != payload.mass,
            f"load.kind: {load} (it looks for no load)": load != "none",
        }
        found = [name for name, is_there in unknown.items() if is_there]
        if found:
            raise ConfigError(
                f"{self.source}: the loop on the board does not know {', '.join(found)}. Run the loop on a host, or give"
                " the board a robot file without them"
            )

    @property
    def at_rest(self) -> Target:
        """The shape at rest with the controller's weights, which the board keeps until another target arrives."""
        weight = direction_weight(self.robot.length, self.controller.tip_direction_weight)
        return rest_target(self.robot, tip_position_weight=self.controller.tip_position_weight, tip_direction_weight=weight)


def least_tensions(parameters: LoopParameters) -> np.ndarray:
    """Return the lower bounds (m,) of the tensions in N, as the inverse controller's."""
    robot, option = parameters.robot, parameters.controller.inverse.pretension
    own = [option if cable.pretension is None else cable.pretension for cable in robot.cables]
    return np.minimum(np.maximum(own, robot.limits.tension_min), robot.limits.tension_max)


def motor_numbers(parameters: LoopParameters) -> list[int]:
    """Return the number, 1 to 8, of each cable's motor on the board's bus. Raises ConfigError for motors that are shared."""
    hardware = parameters.hardware
    if not hardware.transmission.direct:
        raise ConfigError(
            f"{parameters.source}: motors move several cables, or cables several motors;"
            " the loop on the board needs one motor for each cable"
        )
    numbers = {cable: motor.can_id for motor in hardware.motors for cable in motor.ratios}
    return [numbers[name] for name in parameters.robot.cable_names]


def settings(parameters: LoopParameters, reach: float, joystick_bend: float, turn: BaseTurn, law_share: int = 1) -> np.ndarray:
    """Return the floats (n,) of gc_settings.

    reach: largest |q| of the reduced model; joystick_bend: rad at full deflection; turn: of the robot's model; law_share: points
    of a law of rubber of which a step computes the stiffness. Raises ConfigError for motors that are shared.
    """
    robot, wanted = parameters.robot, parameters.at_rest
    options, orientation = parameters.controller.inverse, parameters.estimator.filter
    calibration, prediction = parameters.estimator.calibration, parameters.estimator.prediction
    numbers = motor_numbers(parameters)
    limits, rest, sensor, spikes = robot.limits, orientation.rest, orientation.sensor, orientation.spikes
    values: list[float] = [
        robot.length, reach, SAMPLE_PERIOD,
        limits.tension_max, limits.tension_rate, limits.displacement_min, limits.displacement_max, limits.displacement_rate,
        options.axial_weight, options.energy_weight, options.proximal_weight, options.slack_of(robot.length),
        options.tolerance_of(robot.length),
        options.tilt_tolerance,
        *wanted.tip_position, *wanted.direction_or_zeros, wanted.tip_position_weight, wanted.tip_direction_weight, joystick_bend,
        *quat.normalised(quat.from_roll_pitch_yaw(*robot.imu_mount.rpy)),
        *calibration.accel_scale, *calibration.accel_offset, *calibration.gyro_offset,
        prediction.horizon, prediction.trend_time, prediction.longest_trend,
        orientation.gravity, orientation.gyro_noise, orientation.gyro_noise_per_rate, orientation.accel_noise,
        orientation.bias_walk, orientation.bias_walk_stable, orientation.bias_initial, orientation.velocity_noise,
        orientation.rest_noise, float(orientation.bias_estimation),
        rest.time_constant, rest.gyro_deviation, rest.accel_deviation, rest.accel_drift, rest.minimum_time, rest.largest_bias,
        sensor.gyro_range, sensor.accel_range, sensor.delay, sensor.stuck_time, sensor.largest_gap,
        spikes.gyro, spikes.accel, spikes.ratio, spikes.time_constant, float(spikes.longest),
        *_of_turn(turn), float(law_share), *numbers, *[0] * (CABLES_MAX - len(numbers)),
    ]  # fmt: skip
    return np.array(values, dtype="<f4")


def _of_turn(turn: BaseTurn) -> tuple[float, float]:
    """Return the height in m and the time of the low-pass in s; zeros where the forces of turns do not count."""
    counts = turn.options.enabled and turn.height > 0.0
    return (turn.height, turn.options.lag * turn.period) if counts else (0.0, 0.0)
