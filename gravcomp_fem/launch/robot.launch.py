"""The nodes of one robot for `ros2 launch gravcomp_fem robot.launch.py`, as `./gravcomp up` starts them.

The bridge follows from the robot file: can_bridge, or joint_bridge where it has hardware.joints.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from gravcomp.launcher.robot_graph import RobotGraph, private_channels

ARGUMENTS = (
    ("robot", "article", "name of a shipped robot or path of a robot file"),
    ("interface", "", "python-can interface in place of the robot file's, such as socketcan"),
    ("channel", "", "channel of the interface, such as can0; with several buses one each, by commas"),
    ("namespace", "", "namespace of all nodes, such as /left, for several robots in one graph"),
    ("virtual", "false", "true: start the virtual robot as well, on a bus of its own"),
    ("composed", "false", "true: run estimator, simulator and controller in one process"),
    ("viewer", "false", "true: start the live page"),
    ("use_sim_time", "false", "true: the nodes use the time of /clock"),
)
"""Name, default and meaning."""


def generate_launch_description() -> LaunchDescription:
    """Return the arguments and the nodes."""
    declared = [DeclareLaunchArgument(name, default_value=default, description=text) for name, default, text in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[Node]:
    given = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    virtual = _flag("virtual", given["virtual"])
    interface, channel = given["interface"], given["channel"]
    if virtual and not (interface or channel):
        # On the bus of the robot file, several virtual robots on one machine would receive each other's frames.
        interface, channel = "udp_multicast", private_channels(given["robot"])
    graph = RobotGraph(given["robot"], interface, channel, given["namespace"])
    specs = graph.loop(virtual, _flag("composed", given["composed"]))
    if virtual:
        specs.append(graph.node("gravcomp_hw", "virtual_robot", motion="topic"))
    if _flag("viewer", given["viewer"]):
        specs.append(graph.node("gravcomp_fem", "viewer"))
    shared = {"use_sim_time": _flag("use_sim_time", given["use_sim_time"])}
    return [
        Node(
            package=spec.package,
            executable=spec.executable,
            namespace=spec.namespace,
            parameters=[{**spec.parameters, **shared}],
            remappings=list(spec.remappings.items()),
            output="screen",
        )
        for spec in specs
    ]


def _flag(name: str, value: str) -> bool:
    if value.lower() not in ("true", "false"):
        raise ValueError(f"{name} is '{value}'; allowed: true, false")
    return value.lower() == "true"
