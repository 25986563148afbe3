"""The nodes of the graph with their parameters, topics and services.

The tables in the documents, the doctor and the tests of the running graph read this one table.
"""

from gravcomp.graph.interface import Node, Port

_PARAMETERS = "gravcomp.graph.parameters"
_DIAGNOSTICS = Port("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "state of the node, 1 Hz")
_CONTROLLER = (
    Port(
        "CONTROLLER/joint_trajectory",
        "trajectory_msgs/msg/JointTrajectory",
        "angles in rad (command: trajectory)",
        optional=True,
    ),
    Port(
        "CONTROLLER/commands",
        "std_msgs/msg/Float64MultiArray",
        "angles in rad or efforts in N m (position, effort)",
        optional=True,
    ),
)

NODES = (
    Node(
        "gravcomp_hw", "can_bridge", "drives the cables over CAN; publishes the IMU samples and the state of the cables",
        f"{_PARAMETERS}.can_bridge:CanBridgeParameters",
        subscribes=(
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "cable displacements in m, positive: pulled in"),
            Port("imu/heater", "std_msgs/msg/Float32", "duty of the IMU's heater, 0 to 1"),
        ),
        publishes=(
            Port("imu/data_raw", "sensor_msgs/msg/Imu", "specific force (m/s^2) and angular rate (rad/s) in imu_link", 100.0),
            Port("imu/temperature", "sensor_msgs/msg/Temperature", "temperature of the IMU in degC"),
            Port("cable/state", "gravcomp_msgs/msg/CableState", "bridge state, measured displacements (m) and tensions (N)"),
            Port("joint_states", "sensor_msgs/msg/JointState", "the cables as prismatic joints: m, m/s, N"),
            _DIAGNOSTICS,
        ),
        services=(
            Port("~/home", "std_srvs/srv/Trigger", "tighten each cable and set its zero position"),
            Port("~/stop", "std_srvs/srv/Trigger", "set all currents to zero immediately"),
            Port("~/release", "std_srvs/srv/Trigger", "pay the cables out, then set all currents to zero"),
            Port("~/resume", "std_srvs/srv/Trigger", "continue after a stop or a fault"),
        ),
    ),
    Node(
        "gravcomp_hw", "joint_bridge", "drives the cables through the joints of a ros2_control robot, in place of can_bridge",
        f"{_PARAMETERS}.joint_bridge:JointBridgeParameters",
        subscribes=(
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "cable displacements in m, positive: pulled in"),
            Port("joint_states", "sensor_msgs/msg/JointState", "angles of the joints that wind the cables, rad"),
            Port("imu/data_raw", "sensor_msgs/msg/Imu", "only whether samples arrive (require_imu)", optional=True),
        ),
        publishes=(
            Port("cable/state", "gravcomp_msgs/msg/CableState", "bridge state, measured displacements (m) and tensions (N)"),
            *_CONTROLLER,
            _DIAGNOSTICS,
        ),
        services=(
            Port("~/stop", "std_srvs/srv/Trigger", "drive no joint: no effort, or positions as they are"),
            Port("~/release", "std_srvs/srv/Trigger", "pay the cables out, then drive no joint"),
            Port("~/resume", "std_srvs/srv/Trigger", "continue after a stop or a fault"),
        ),
    ),
    Node(
        "gravcomp_hw", "joint_robot", "stands in for a ros2_control robot: its controller, its joint_states and an IMU",
        f"{_PARAMETERS}.joint_robot:JointRobotParameters",
        subscribes=_CONTROLLER,
        publishes=(
            Port("joint_states", "sensor_msgs/msg/JointState", "angles (rad), speeds (rad/s), efforts (N m) of the joints"),
            Port(
                "imu/data_raw", "sensor_msgs/msg/Imu", "specific force (m/s^2) and angular rate (rad/s) in imu_link",
                optional=True,
            ),
            Port("imu/temperature", "sensor_msgs/msg/Temperature", "temperature of the IMU in degC", optional=True),
            _DIAGNOSTICS,
        ),
    ),
    Node(
        "gravcomp_estimation", "imu_estimator", "estimates orientation and gravity, and controls the IMU's temperature",
        f"{_PARAMETERS}.imu_estimator:ImuEstimatorParameters",
        subscribes=(
            Port("imu/data_raw", "sensor_msgs/msg/Imu", "specific force (m/s^2) and angular rate (rad/s) in imu_link"),
            Port("imu/temperature", "sensor_msgs/msg/Temperature", "temperature of the IMU in degC"),
            Port(
                "arm/acceleration", "geometry_msgs/msg/Vector3Stamped", "of the IMU, m/s^2 in soft_base (arm_acceleration)",
                optional=True,
            ),
        ),
        publishes=(
            Port("imu/data", "sensor_msgs/msg/Imu", "with orientation and covariances, bias removed (REP-145)", 100.0),
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "gravity in m/s^2, in soft_base", 100.0),
            Port("imu/bias", "geometry_msgs/msg/Vector3Stamped", "gyroscope bias in rad/s"),
            Port("imu/status", "gravcomp_msgs/msg/ImuStatus", "IMU health, bias and temperature state"),
            Port("imu/heater", "std_msgs/msg/Float32", "duty of the IMU's heater, 0 to 1"),
            _DIAGNOSTICS,
        ),
        services=(
            Port("~/reset", "std_srvs/srv/Trigger", "restart orientation, bias and heater control"),
            Port("~/reset_bias", "std_srvs/srv/Trigger", "restart the bias estimate"),
        ),
    ),
    Node(
        "gravcomp_fem", "fem_simulator", "computes the robot's shape under the virtual gravity, and its compliance to the cables",
        f"{_PARAMETERS}.fem_simulator:FemSimulatorParameters",
        subscribes=(
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "gravity in m/s^2, in soft_base"),
            Port("imu/data", "sensor_msgs/msg/Imu", "rate of the base in rad/s (turn.enabled)", optional=True),
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "cable displacements in m (cables_from: command)"),
            Port("cable/state", "gravcomp_msgs/msg/CableState", "cable displacements in m (cables_from: state)", optional=True),
            Port("external/wrench", "geometry_msgs/msg/WrenchStamped", "known force (N) and moment (N m); the frame says where"),
            Port("measured/tip", "geometry_msgs/msg/PoseStamped", "tip measured by a tracker, m"),
            Port("measured/tension", "sensor_msgs/msg/JointState", "tensions of the cables in effort, N (load.kind)"),
        ),
        publishes=(
            Port("robot/deformation", "gravcomp_msgs/msg/Deformation", "shape, cables and compliance", 100.0),
            Port("robot/tip", "geometry_msgs/msg/PoseStamped", "pose of the tip in soft_base, m", 100.0),
            Port("robot/markers", "visualization_msgs/msg/MarkerArray", "markers for RViz, up to 10 Hz"),
            Port("estimated/wrench", "gravcomp_msgs/msg/WrenchEstimate", "unknown load at the tip, with covariance (load.kind)"),
            Port("/tf", "tf2_msgs/msg/TFMessage", "frames of tip and backbone, where tf2_msgs is installed", optional=True),
            Port("joint_states", "sensor_msgs/msg/JointState", "shape as joints of the URDF (shape_joints)", optional=True),
            _DIAGNOSTICS,
        ),
        services=(Port("~/zero_load", "std_srvs/srv/Trigger", "learn the errors of model and sensors without load"),),
    ),
    Node(
        "gravcomp_fem", "inverse_controller", "computes the cable displacements that bring the model to its target",
        f"{_PARAMETERS}.inverse_controller:InverseControllerParameters",
        subscribes=(
            Port("robot/deformation", "gravcomp_msgs/msg/Deformation", "shape and compliance"),
            Port("target", "geometry_msgs/msg/PoseStamped", "pose of the tip in soft_base, m; its z axis is the tip direction"),
            Port("target/shape", "gravcomp_msgs/msg/ShapeTarget", "target tip, direction, backbone points or bend, with weights"),
            Port("measured/tip", "geometry_msgs/msg/PoseStamped", "tip measured by a tracker, m; only its position is used"),
        ),
        publishes=(
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "cable displacements in m, positive: pulled in", 100.0),
            Port("controller/status", "gravcomp_msgs/msg/ControllerStatus", "tracking error and state of the controller"),
            _DIAGNOSTICS,
        ),
        services=(
            Port("~/enable", "std_srvs/srv/SetBool", "start or stop sending commands"),
            Port("~/relax", "std_srvs/srv/Trigger", "pay the cables out until ~/enable is called"),
        ),
    ),
    Node(
        "gravcomp_hw", "virtual_robot", "simulates the hardware: rod, cables, motors and IMU board behind CAN frames",
        f"{_PARAMETERS}.virtual_robot:VirtualRobotNodeParameters",
        subscribes=(
            Port("virtual/base_orientation", "geometry_msgs/msg/QuaternionStamped", "rotation from soft_base to world"),
            Port("virtual/fault", "std_msgs/msg/String", "fault as YAML, {kind: stall, cable: s1c2, duration: 1.0}, or 'clear'"),
            Port("virtual/hand", "std_msgs/msg/String", "spring that pulls the tip to {place_mm: [9, 0, 95]}, or 'release'"),
            Port("virtual/wall", "std_msgs/msg/String", "wall in the keys of scene.planes, {normal: [1, 0, 0], ...}, or 'clear'"),
        ),
        publishes=(
            Port("truth/tip", "geometry_msgs/msg/PoseStamped", "tip in soft_base, m; only for evaluation"),
            Port("truth/backbone", "geometry_msgs/msg/PoseArray", "backbone in soft_base, m; only for evaluation"),
            Port("truth/gravity", "geometry_msgs/msg/Vector3Stamped", "gravity in soft_base, m/s^2; only for evaluation"),
            Port("truth/forces", "gravcomp_msgs/msg/VirtualForces", "forces of walls and of a hand, N; only for evaluation"),
            Port("measured/tip", "geometry_msgs/msg/PoseStamped", "tip as a tracker measures it, m", optional=True),
            Port("measured/tension", "sensor_msgs/msg/JointState", "tensions as load cells measure them, N", optional=True),
            _DIAGNOSTICS,
        ),
    ),
    Node(
        "gravcomp_hw", "judge", "runs release and compensation, and evaluates them with the virtual robot's ground truth",
        f"{_PARAMETERS}.judge:JudgeParameters",
        subscribes=(
            Port("truth/tip", "geometry_msgs/msg/PoseStamped", "ground truth of the tip, m"),
            Port("truth/gravity", "geometry_msgs/msg/Vector3Stamped", "ground truth of gravity, m/s^2"),
            Port("robot/tip", "geometry_msgs/msg/PoseStamped", "the model's tip, m"),
            Port("robot/deformation", "gravcomp_msgs/msg/Deformation", "which model serves"),
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "estimated gravity, m/s^2"),
            Port("imu/data_raw", "sensor_msgs/msg/Imu", "its rate is measured"),
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "its rate is measured"),
            Port("cable/state", "gravcomp_msgs/msg/CableState", "whether the bridge has a fault at the end"),
            Port("controller/status", "gravcomp_msgs/msg/ControllerStatus", "whether the target can be held"),
        ),
        publishes=(_DIAGNOSTICS,),
        tool=True,
    ),
    Node(
        "gravcomp_estimation", "imu_replay", "plays the IMU samples of a recording at their own times",
        f"{_PARAMETERS}.imu_replay:ImuReplayParameters",
        subscribes=(
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "that of the last sample ends it (exit_at_end)", optional=True),
        ),
        publishes=(
            Port("imu/data_raw", "sensor_msgs/msg/Imu", "specific force (m/s^2) and angular rate (rad/s) in imu_link"),
            Port("imu/temperature", "sensor_msgs/msg/Temperature", "temperature of the IMU in degC"),
            Port("/clock", "rosgraph_msgs/msg/Clock", "time of the recording"),
            _DIAGNOSTICS,
        ),
    ),
    Node(
        "gravcomp_estimation", "arm_gravity", "computes gravity from the pose of the arm, in place of the IMU or to check it",
        f"{_PARAMETERS}.arm_gravity:ArmGravityParameters",
        subscribes=(
            Port("joint_states", "sensor_msgs/msg/JointState", "positions of the arm's joints (source: joint_states)"),
            Port("robot_description", "std_msgs/msg/String", "URDF of arm and robot", optional=True),
            Port("/tf", "tf2_msgs/msg/TFMessage", "frames of the arm (source: tf)", optional=True),
            Port("/tf_static", "tf2_msgs/msg/TFMessage", "fixed frames of the arm (source: tf)", optional=True),
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "gravity from the IMU (use: check)", optional=True),
            Port("gravity/imu", "geometry_msgs/msg/Vector3Stamped", "gravity from the IMU (use: fuse)", optional=True),
        ),
        publishes=(
            Port("gravity/arm", "geometry_msgs/msg/Vector3Stamped", "gravity from the arm, m/s^2 (use: check)", optional=True),
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "gravity of the arm, m/s^2 (use: publish, fuse)", optional=True),
            Port(
                "arm/acceleration", "geometry_msgs/msg/Vector3Stamped", "of the IMU, m/s^2 in soft_base (feed_acceleration)",
                optional=True,
            ),
            _DIAGNOSTICS,
        ),
    ),
    Node(
        "gravcomp_fem", "viewer", "serves a live 3D page of the graph, with controls",
        f"{_PARAMETERS}.viewer:ViewerParameters",
        subscribes=(
            Port("robot/deformation", "gravcomp_msgs/msg/Deformation", "shape, cables and gravity"),
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "delay of the command"),
            Port("cable/state", "gravcomp_msgs/msg/CableState", "measured tensions and the bridge's state"),
            Port("controller/status", "gravcomp_msgs/msg/ControllerStatus", "state of the controller"),
            Port("target", "geometry_msgs/msg/PoseStamped", "current target"),
            Port("target/shape", "gravcomp_msgs/msg/ShapeTarget", "current target"),
            Port("truth/backbone", "geometry_msgs/msg/PoseArray", "shape of the virtual robot, where there is one"),
            Port("truth/forces", "gravcomp_msgs/msg/VirtualForces", "forces on the virtual robot, where there is one"),
            Port("estimated/wrench", "gravcomp_msgs/msg/WrenchEstimate", "unknown load at the tip"),
        ),
        publishes=(
            Port("target/shape", "gravcomp_msgs/msg/ShapeTarget", "target set on the page"),
            Port("virtual/base_orientation", "geometry_msgs/msg/QuaternionStamped", "tilt of the base set on the page"),
            Port("virtual/fault", "std_msgs/msg/String", "fault set on the page"),
            Port("virtual/hand", "std_msgs/msg/String", "place to which the user drags the tip of the virtual robot"),
            Port("virtual/wall", "std_msgs/msg/String", "wall that the user puts next to the virtual robot"),
            _DIAGNOSTICS,
        ),
    ),
    Node(
        "gravcomp_fem", "recorder", "writes the graph's topics into a bag",
        f"{_PARAMETERS}.recorder:RecorderParameters",
        subscribes=(Port("*", "any", "every topic of the namespace and every global topic, or those in `topics`"),),
        publishes=(_DIAGNOSTICS,),
        tool=True,
    ),
    Node(
        "gravcomp_fem", "calibrator", "leads through a calibration pose by pose: pulls the cables and writes the measured tips",
        f"{_PARAMETERS}.calibrator:CalibratorParameters",
        subscribes=(
            Port("gravity", "geometry_msgs/msg/Vector3Stamped", "gravity in m/s^2: when the base is turned as planned"),
            Port("cable/state", "gravcomp_msgs/msg/CableState", "displacements from which the cables are moved"),
            Port("measured/tip", "geometry_msgs/msg/PoseStamped", "tip in soft_base, m; another topic by `tip_topic`"),
            Port("imu/data", "sensor_msgs/msg/Imu", "length of the specific force in m/s^2", optional=True),
        ),
        publishes=(
            Port("cable/command", "gravcomp_msgs/msg/CableCommand", "planned displacements of the cables in m"),
            _DIAGNOSTICS,
        ),
        tool=True,
    ),
    Node(
        "gravcomp_fem", "arm_player", "simulates an arm that carries the virtual robot through poses, and measures the tip error",
        f"{_PARAMETERS}.arm_player:ArmPlayerParameters",
        subscribes=(
            Port("truth/tip", "geometry_msgs/msg/PoseStamped", "tip in soft_base, m; only for evaluation"),
            Port("cable/state", "gravcomp_msgs/msg/CableState", "state of the bridge"),
            Port("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "difference of arm and IMU, from arm_gravity"),
        ),
        publishes=(
            Port("joint_states", "sensor_msgs/msg/JointState", "positions of the arm's joints in rad"),
            Port("robot_description", "std_msgs/msg/String", "URDF of arm and robot"),
            Port("virtual/base_orientation", "geometry_msgs/msg/QuaternionStamped", "rotation from soft_base to world"),
            _DIAGNOSTICS,
        ),
    ),
)  # fmt: skip


def node(executable: str) -> Node:
    """The node with this executable. Raises StopIteration when there is none."""
    return next(entry for entry in NODES if entry.executable == executable)
