"""What a command makes ready before it starts nodes: once for a robot, once for a machine."""

from gravcomp.commands.model.build import prepare_model
from gravcomp.launcher.robot_graph import check_robot_file


def prepare(robot: str, virtual: bool) -> None:
    """Check the robot's file, build its reduced model, and compile what the nodes will run. Raises ConfigError.

    Before the nodes start, because they share two minutes of compiling badly.
    """
    check_robot_file(robot)
    prepare_model(robot)
    _compile(robot, virtual)


def _compile(robot: str, virtual: bool) -> None:
    from rich.console import Console

    from gravcomp.description.robot_file import load_robot_file
    from gravcomp.inverse import warm_up as warm_up_inverse
    from gravcomp.virtual.warm_up import warm_up as warm_up_virtual_robot

    with Console(stderr=True).status("preparing the nodes (compiles once)"):
        warm_up_inverse(load_robot_file(robot).robot)
        if virtual:
            warm_up_virtual_robot()
