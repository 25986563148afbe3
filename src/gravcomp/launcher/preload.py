"""Work that a node host does once for its nodes, after the imports."""

import contextlib
import importlib
import inspect
import sys

from gravcomp.launcher import compilation


def load_type_supports() -> None:
    """Load what converts the messages and services of the imported packages; rclpy does it in each node at their first use.

    Most of it is the import of the code generator's package, which parses interface definitions.
    """
    importlib.import_module("rosidl_generator_py")
    for name in [name for name in sys.modules if name.endswith((".msg", ".srv"))]:
        for _, kind in inspect.getmembers(sys.modules[name], inspect.isclass):
            load = getattr(type(kind), "__import_type_support__", None)
            if load is not None and getattr(type(kind), "_TYPE_SUPPORT", None) is None:
                with contextlib.suppress(Exception):  # the node that needs it reports the error
                    load()


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
