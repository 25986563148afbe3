"""What each node takes and gives: the graph's interface in one table, from which the documentation and the doctor read.

Topic and service names are relative to the robot's namespace; those with ~ to the node; those with / to none.
"""

import importlib
from dataclasses import dataclass

from gravcomp.config import DeclaredParameter, declared_parameters
from gravcomp.graph.parameters.shared import SharedParameters


@dataclass(frozen=True)
class Port:
    """A topic or service: its name, its type, what it carries with its unit; `rate` in Hz where the graph keeps one."""

    name: str
    type: str
    meaning: str
    rate: float | None = None
    optional: bool = False  # not there in every configuration


@dataclass(frozen=True)
class Node:
    """A node: where it is found, what it is for, and its ports.

    parameters: module and data class, none for a program that only looks; tool: watches or works a graph from outside, which does not
    depend on it.
    """

    package: str
    executable: str
    summary: str
    parameters: str = ""
    takes: tuple[Port, ...] = ()
    gives: tuple[Port, ...] = ()
    services: tuple[Port, ...] = ()
    tool: bool = False

    def declared_parameters(self) -> list[DeclaredParameter]:
        """The node's parameters, those that every node has first."""
        if not self.parameters:
            return []
        module, name = self.parameters.split(":")
        return declared_parameters(SharedParameters) + declared_parameters(getattr(importlib.import_module(module), name))


_PARAMETERS = "gravcomp.graph.parameters"
_DIAGNOSTICS = Port("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "state of the node, 1 Hz")

NODES = (
    Node(
        "gravcomp_hw", "can_bridge", "drives the cables over CAN; publishes the IMU and what the cables do",
        f"{_PARAMETERS}.can_bridge:CanBridgeParameters",
        takes=(
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "displacements in m, pulled in is positive"),
            Port("imu/heater", "std_msgs/msg/Float32", "duty of the IMU's heater, 0..1"),
        ),
        gives=(
            Port("imu/data_raw", "sensor_msgs/msg/Imu", "m/s^2 and rad/s in imu_link, no orientation", 100.0),
            Port("imu/temperature", "sensor_msgs/msg/Temperature", "degC"),
            Port("cable/state", "gravcomp_msgs/msg/CableState", "state of the bridge, measured displacements in m"),
            Port("joint_states", "sensor_msgs/msg/JointState", "the cables as joints: m, m/s, N"),
            _DIAGNOSTICS,
        ),
        services=(
            Port("~/home", "std_srvs/srv/Trigger", "tighten each cable, set its zero"),
            Port("~/stop", "std_srvs/srv/Trigger", "zero current at once"),
            Port("~/release", "std_srvs/srv/Trigger", "zero current, the cables may run out"),
            Port("~/resume", "std_srvs/srv/Trigger", "go on after a stop or a fault"),
        ),
    ),
    Node(
        "gravcomp_estimation", "imu_estimator", "where gravity points, and the temperature control of the IMU",
        f"{_PARAMETERS}.imu_estimator:ImuEstimatorParameters",
        takes=(
            Port("imu/data_raw", "sensor_msgs/msg/Imu", "m/s^2 and rad/s in imu_link"),
            Port("imu/temperature", "sensor_msgs/msg/Temperature", "degC"),
        ),
        gives=(
            Port("imu/data", "sensor_msgs/msg/Imu", "with orientation and covariances, bias taken off (REP-145)", 100.0),
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "m/s^2 in soft_base", 100.0),
            Port("imu/bias", "geometry_msgs/msg/Vector3Stamped", "of the gyroscope, rad/s"),
            Port("imu/status", "gravcomp_msgs/msg/ImuStatus", "what is thought of the IMU"),
            Port("imu/heater", "std_msgs/msg/Float32", "duty of the heater, 0..1"),
            _DIAGNOSTICS,
        ),
        services=(
            Port("~/reset", "std_srvs/srv/Trigger", "begin anew"),
            Port("~/reset_bias", "std_srvs/srv/Trigger", "forget the bias"),
        ),
    ),
    Node(
        "gravcomp_fem", "fem_simulator", "the robot's shape under the virtual gravity, and how it answers to the cables",
        f"{_PARAMETERS}.fem_simulator:FemSimulatorParameters",
        takes=(
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "m/s^2 in soft_base"),
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "what drives the model's cables (cables_from: command)"),
            Port("cable/state", "gravcomp_msgs/msg/CableState", "or this (cables_from: state)", optional=True),
        ),
        gives=(
            Port("robot/deformation", "gravcomp_msgs/msg/Deformation", "shape, cables, and the linear answer to the cables", 100.0),
            Port("robot/tip", "geometry_msgs/msg/PoseStamped", "m, in soft_base", 100.0),
            Port("robot/markers", "visualization_msgs/msg/MarkerArray", "for RViz, up to 10 Hz"),
            Port("/tf", "tf2_msgs/msg/TFMessage", "soft_tip and backbone frames, where tf2_msgs is installed", optional=True),
            _DIAGNOSTICS,
        ),
    ),
    Node(
        "gravcomp_fem", "inverse_controller", "the cable displacements that bring the modelled robot to its target",
        f"{_PARAMETERS}.inverse_controller:InverseControllerParameters",
        takes=(
            Port("robot/deformation", "gravcomp_msgs/msg/Deformation", "shape and linear answer"),
            Port("target", "geometry_msgs/msg/PoseStamped", "pose of the tip in soft_base, m; its z axis is the direction"),
            Port("target/shape", "gravcomp_msgs/msg/ShapeTarget", "tip, direction, backbone points or a bend, with weights"),
        ),
        gives=(
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "displacements in m, pulled in is positive", 100.0),
            Port("controller/status", "gravcomp_msgs/msg/ControllerStatus", "how well the target is kept"),
            _DIAGNOSTICS,
        ),
        services=(
            Port("~/enable", "std_srvs/srv/SetBool", "compensate, or send nothing"),
            Port("~/relax", "std_srvs/srv/Trigger", "pay the cables out until ~/enable is called"),
        ),
    ),
    Node(
        "gravcomp_hw", "virtual_robot", "the robot that is not there: rod, cables, motors and IMU board behind CAN frames",
        f"{_PARAMETERS}.virtual_robot:VirtualRobotNodeParameters",
        takes=(
            Port("virtual/base_orientation", "geometry_msgs/msg/QuaternionStamped", "world from soft_base (motion: topic, or steerable)"),
            Port("virtual/fault", "std_msgs/msg/String", "a fault as YAML, e.g. {kind: stall, cable: s1c2, duration: 1.0}; or 'clear'"),
        ),
        gives=(
            Port("truth/tip", "geometry_msgs/msg/PoseStamped", "m, in soft_base; for judging alone"),
            Port("truth/backbone", "geometry_msgs/msg/PoseArray", "m, in soft_base; for judging alone"),
            Port("truth/gravity", "geometry_msgs/msg/Vector3Stamped", "m/s^2, in soft_base; for judging alone"),
            _DIAGNOSTICS,
        ),
    ),
    Node(
        "gravcomp_hw", "judge", "plays sag and compensation on a running graph and judges it by the virtual robot's truth",
        f"{_PARAMETERS}.judge:JudgeParameters",
        takes=(
            Port("truth/tip", "geometry_msgs/msg/PoseStamped", "m"),
            Port("truth/gravity", "geometry_msgs/msg/Vector3Stamped", "m/s^2"),
            Port("robot/tip", "geometry_msgs/msg/PoseStamped", "m"),
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "m/s^2"),
            Port("imu/data_raw", "sensor_msgs/msg/Imu", "its rate"),
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "its rate"),
        ),
        gives=(_DIAGNOSTICS,),
        tool=True,
    ),
    Node(
        "gravcomp_estimation", "imu_replay", "the IMU stream of a bag at its own times",
        f"{_PARAMETERS}.imu_replay:ImuReplayParameters",
        gives=(
            Port("imu/data_raw", "sensor_msgs/msg/Imu", "m/s^2 and rad/s in imu_link"),
            Port("imu/temperature", "sensor_msgs/msg/Temperature", "degC"),
            Port("/clock", "rosgraph_msgs/msg/Clock", "the bag's time"),
            _DIAGNOSTICS,
        ),
    ),
    Node(
        "gravcomp_estimation", "arm_gravity", "gravity from the arm that carries the robot: in place of the IMU, or as a check of it",
        f"{_PARAMETERS}.arm_gravity:ArmGravityParameters",
        takes=(
            Port("joint_states", "sensor_msgs/msg/JointState", "of the arm (source: joint_states)"),
            Port("robot_description", "std_msgs/msg/String", "URDF of arm and robot", optional=True),
            Port("/tf", "tf2_msgs/msg/TFMessage", "the arm's frames, in place of both (source: tf)", optional=True),
            Port("/tf_static", "tf2_msgs/msg/TFMessage", "the arm's fixed frames (source: tf)", optional=True),
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "the IMU's, to be checked (use: check)", optional=True),
        ),
        gives=(
            Port("gravity/arm", "geometry_msgs/msg/Vector3Stamped", "m/s^2 in soft_base, from the arm (use: check)", optional=True),
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "the same in place of imu_estimator (use: publish)", optional=True),
            _DIAGNOSTICS,
        ),
    ),
    Node(
        "gravcomp_fem", "viewer", "a live 3D page of what is published, with controls",
        f"{_PARAMETERS}.viewer:ViewerParameters",
        takes=(
            Port("robot/deformation", "gravcomp_msgs/msg/Deformation", "body, cables and gravity"),
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "its delay"),
            Port("cable/state", "gravcomp_msgs/msg/CableState", "tensions by the motors, and the bridge's state"),
            Port("controller/status", "gravcomp_msgs/msg/ControllerStatus", "what the controller says"),
            Port("target", "geometry_msgs/msg/PoseStamped", "the target, whoever sets it"),
            Port("target/shape", "gravcomp_msgs/msg/ShapeTarget", "likewise"),
            Port("truth/backbone", "geometry_msgs/msg/PoseArray", "the virtual robot's shape, where there is one"),
        ),
        gives=(
            Port("target/shape", "gravcomp_msgs/msg/ShapeTarget", "what is picked on the page"),
            Port("virtual/base_orientation", "geometry_msgs/msg/QuaternionStamped", "how the base is tilted on the page"),
            Port("virtual/fault", "std_msgs/msg/String", "what is broken on the page"),
            _DIAGNOSTICS,
        ),
    ),
    Node(
        "gravcomp_fem", "recorder", "the graph's topics into a bag, as they come",
        f"{_PARAMETERS}.recorder:RecorderParameters",
        takes=(Port("*", "any", "every topic of the namespace and the global ones, or those of `topics`"),),
        gives=(_DIAGNOSTICS,),
        tool=True,
    ),
    Node(
        "gravcomp_fem", "arm_player", "an arm that is not there: carries the virtual robot through poses and judges it",
        f"{_PARAMETERS}.arm_player:ArmPlayerParameters",
        takes=(
            Port("truth/tip", "geometry_msgs/msg/PoseStamped", "m, in soft_base; for judging alone"),
            Port("cable/state", "gravcomp_msgs/msg/CableState", "whether the bridge follows"),
            Port("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "by how much arm_gravity says that arm and IMU disagree"),
        ),
        gives=(
            Port("joint_states", "sensor_msgs/msg/JointState", "the arm's joints in rad"),
            Port("robot_description", "std_msgs/msg/String", "URDF of arm and robot"),
            Port("virtual/base_orientation", "geometry_msgs/msg/QuaternionStamped", "world from soft_base, as the arm holds it"),
            _DIAGNOSTICS,
        ),
    ),
)  # fmt: skip


def node(executable: str) -> Node:
    """The node of that name."""
    return next(entry for entry in NODES if entry.executable == executable)
