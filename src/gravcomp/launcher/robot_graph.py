"""Nodes of a robot's graph, with their parameters."""

from dataclasses import dataclass, field
from typing import Any

from gravcomp.launcher.node_process import NodeSpec

LOOP = (
    ("gravcomp_hw", "can_bridge"),
    ("gravcomp_estimation", "imu_estimator"),
    ("gravcomp_fem", "fem_simulator"),
    ("gravcomp_fem", "inverse_controller"),
)
"""The four nodes of the loop: package and executable."""

COMPOSED = ("gravcomp_fem", "composed_loop")
"""The inner nodes of LOOP, all but the first, in one process."""

JOINT_BRIDGE = ("gravcomp_hw", "joint_bridge")
"""In place of the first node of LOOP for a robot with `hardware.joints`."""

JOINT_ROBOT = ("gravcomp_hw", "joint_robot")
"""Between joint_bridge and the virtual robot."""


@dataclass(frozen=True)
class RobotGraph:
    """Nodes of one robot.

    robot: name of a shipped robot or path of a robot file; interface, channel: CAN bus in place of the file's (with several buses
    one channel each, separated by commas); namespace: of all nodes; parameters: {executable: {parameter: value}} in addition to
    the robot file; seed: of the virtual robot, in place of the file's.
    """

    robot: str
    interface: str = ""
    channel: str = ""
    namespace: str = ""
    parameters: dict = field(default_factory=dict)
    seed: int | None = None

    def loop(self, virtual: bool = False, composed: bool = False) -> list[NodeSpec]:
        """Return the four nodes of the loop: bridge, estimator, simulator, controller. Raises ConfigError for a wrong file.

        virtual: for the virtual robot, which joints need a node more for; composed: the inner three in one process.
        """
        from gravcomp.description import load_robot_file

        nodes: tuple[tuple[str, str], ...] = LOOP
        if load_robot_file(self.robot).has_joints:
            nodes = (JOINT_BRIDGE, *LOOP[1:]) + ((JOINT_ROBOT,) if virtual else ())
        specs = [self.node(package, executable) for package, executable in nodes]
        return [specs[0], self._composed(specs[1:4]), *specs[4:]] if composed else specs

    def _composed(self, specs: list[NodeSpec]) -> NodeSpec:
        """Return the process of several nodes; the parameters of one are given with its name."""
        own = {f"{spec.executable}:{k}": v for spec in specs for k, v in spec.parameters.items() if k != "robot"}
        return NodeSpec(*COMPOSED, {"robot": self.robot, **own}, self.namespace)

    def node(self, package: str, executable: str, **parameters: Any) -> NodeSpec:
        """Return one node of this robot."""
        given: dict[str, Any] = {"robot": self.robot}
        if executable in ("can_bridge", "joint_robot", "virtual_robot", "judge"):
            given.update({key: value for key, value in (("interface", self.interface), ("channel", self.channel)) if value})
        if executable in ("virtual_robot", "judge") and self.seed is not None:
            given["seed"] = self.seed
        given.update(self.parameters.get(executable, {}))
        given.update(parameters)
        return NodeSpec(package, executable, given, self.namespace)


def private_channels(robot: str) -> str:
    """Return channels for the buses of a robot that no other run on this host uses, separated by commas. Raises ConfigError."""
    from gravcomp.canbus.multicast import private_channel
    from gravcomp.description import load_robot_file

    return ",".join(private_channel() for _ in load_robot_file(robot).hardware.all_buses)


def check_robot_file(robot: str, seed: int | None = None) -> str:
    """Check every section of a robot file before any process starts. Raises ConfigError.

    Returns what the virtual robot is, in one sentence; `seed` replaces the file's.
    """
    from gravcomp.description import load_robot_file
    from gravcomp.graph.node_sections import check_node_sections
    from gravcomp.virtual.described import described

    file = load_robot_file(robot)
    _ = file.hardware  # reading it checks it
    check_node_sections(file)
    return described(file, seed).draw().summary()
