"""Work that a node host does once for its nodes, after the imports."""

from gravcomp.launcher import compilation


def call_compiled() -> None:
    """Call a small compiled function, which loads what every compiled function needs (0.3 s).

    Does nothing when the function is not compiled yet.
    """
    if compilation.missing(["controller"]):
        return
    import numpy as np

    from gravcomp.description import load_robot_file
    from gravcomp.inverse.limits import within_limits

    robot = load_robot_file("article").robot
    cables = np.zeros(len(robot.cables))
    within_limits(cables, cables, robot.limits, 0.0)
