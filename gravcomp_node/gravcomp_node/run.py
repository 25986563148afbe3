"""Process of a node: from the command line to a clean shutdown on SIGINT or SIGTERM."""

import gc
import signal
import sys

import rclpy
from rclpy.signals import SignalHandlerOptions

from gravcomp.config import ConfigError
from gravcomp_node.executor import StreamExecutor
from gravcomp_node.managed_node import ManagedNode

USAGE = """{name}: a node of gravcomp. {purpose}

usage: ros2 run PACKAGE {name} [--ros-args -p NAME:=VALUE ... -r OLD:=NEW ... -r __ns:=NAMESPACE]

parameters (name, default, allowed, meaning):
{parameters}"""


def run(node_class: type[ManagedNode], argv: list[str] | None = None) -> int:
    """Run the node until a signal arrives or the node has finished.

    Return the exit code: 0, or 2 after an error, with one sentence on stderr.
    """
    argv = sys.argv if argv is None else argv
    if {"-h", "--help"} & set(argv[1:]):
        print(_help(node_class))
        return 0
    # These handlers only set a flag; rclpy's handlers would shut the context down during a callback.
    stop = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.append(True))
    node = executor = None
    try:
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
        node = node_class()
        node.start()
        executor = StreamExecutor(node)
        while not stop and not node.finished:
            executor.spin_once(timeout=0.1)
    except (ConfigError, rclpy.exceptions.ROSInterruptException, rclpy._rclpy_pybind11.RCLError) as error:
        print(f"{node_class.name}: {error}", file=sys.stderr, flush=True)
        return 2
    finally:
        if executor is not None:
            executor.shutdown()
        if node is not None:
            node.shut_down()
            node.destroy_node()
        rclpy.try_shutdown()
        gc.unfreeze()  # the objects frozen by ManagedNode end with the node
    return 0


def _help(node_class: type[ManagedNode]) -> str:
    from gravcomp.config import declared_parameters
    from gravcomp.graph.parameters.shared import SharedParameters

    lines = []
    for leaf in declared_parameters(SharedParameters) + declared_parameters(node_class.parameters_class):
        lines.append(f"  {leaf.key}  {leaf.default}  {leaf.parameter.allowed()}: {leaf.parameter.description}")
    return USAGE.format(
        name=node_class.name, purpose=(node_class.__doc__ or "").strip().splitlines()[0], parameters="\n".join(lines)
    )
