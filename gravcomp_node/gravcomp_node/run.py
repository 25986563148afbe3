"""Process of a node: from the command line to a clean shutdown on SIGINT or SIGTERM."""

import gc
import os
import signal
import sys
import time
from pathlib import Path

import rclpy
from rclpy.signals import SignalHandlerOptions

from gravcomp.config import ConfigError
from gravcomp.launcher.node_process import ACTIVE_FILE, GATE_FILE
from gravcomp_node.executor import StreamExecutor
from gravcomp_node.local_topics import LocalTopics
from gravcomp_node.managed_node import ManagedNode

_POLL = 0.01  # s
USAGE = """{name}: a node of gravcomp. {purpose}

usage: ros2 run PACKAGE {name} [--ros-args -p NAME:=VALUE ... -r OLD:=NEW ... -r __ns:=NAMESPACE]

parameters (name, default, allowed, meaning):
{parameters}"""


def run(*node_classes: type[ManagedNode], argv: list[str] | None = None) -> int:
    """Run the nodes until a signal arrives or one of them has finished; several share one executor and their messages.

    Return the exit code: 0, or 2 after an error, with one sentence on stderr.
    """
    argv = sys.argv if argv is None else argv
    if {"-h", "--help"} & set(argv[1:]):
        print("\n".join(_help(node_class) for node_class in node_classes))
        return 0
    local = LocalTopics() if len(node_classes) > 1 else None
    # These handlers only set a flag; rclpy's handlers would shut the context down during a callback.
    stop = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.append(True))
    nodes: list[ManagedNode] = []
    executor = None
    name = node_classes[0].name
    try:
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
        for node_class in node_classes:
            name = node_class.name
            nodes.append(node_class(local))
            nodes[-1].start(lambda: _wait_for_gate(stop))
        note = os.environ.get(ACTIVE_FILE)
        if note and all(node.is_active for node in nodes):
            Path(note).touch()
        executor = StreamExecutor(*nodes, local=local)
        while not stop and not any(node.finished for node in nodes):
            executor.spin_once(timeout=0.1)
    except (ConfigError, rclpy.exceptions.ROSInterruptException, rclpy._rclpy_pybind11.RCLError) as error:
        print(f"{name}: {error}", file=sys.stderr, flush=True)
        return 2
    finally:
        if executor is not None:
            executor.shutdown()
        for node in nodes:
            node.shut_down()
            node.destroy_node()
        rclpy.try_shutdown()
        gc.unfreeze()  # the objects frozen by ManagedNode end with the node
    return 0


def _wait_for_gate(stop: list) -> bool:
    """Wait until the launcher lets the nodes become active, where it wants that. Return False after a signal."""
    gate = os.environ.get(GATE_FILE)
    while gate and not stop and not os.path.exists(gate):
        time.sleep(_POLL)
    return not stop


def _help(node_class: type[ManagedNode]) -> str:
    from gravcomp.config import declared_parameters
    from gravcomp.graph.parameters.shared import SharedParameters

    lines = []
    for leaf in declared_parameters(SharedParameters) + declared_parameters(node_class.parameters_class):
        lines.append(f"  {leaf.key}  {leaf.default}  {leaf.parameter.allowed()}: {leaf.parameter.description}")
    return USAGE.format(
        name=node_class.name, purpose=(node_class.__doc__ or "").strip().splitlines()[0], parameters="\n".join(lines)
    )
