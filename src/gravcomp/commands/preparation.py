"""What a command makes ready before it starts nodes: once for a robot, once for a machine."""

from gravcomp.commands.model.build import prepare_model
from gravcomp.launcher.robot_graph import check_robot_file


def prepare(robot: str, virtual: bool) -> None:
    """Check the robot's file, build its reduced model, and compile the virtual robot where there is one. Raises ConfigError.

    Before the nodes start, because they share two minutes of compiling badly.
    """
    check_robot_file(robot)
    prepare_model(robot)
    if virtual:
        _compile_virtual_robot()


def _compile_virtual_robot() -> None:
    from rich.console import Console

    from gravcomp.virtual.warm_up import warm_up

    with Console(stderr=True).status("preparing the virtual robot (compiles once)"):
        warm_up()
