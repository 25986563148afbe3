"""`gravcomp up`: start the graph on real hardware, or as the robot file says, until Ctrl-C."""

import argparse
import socket
import time
from typing import TYPE_CHECKING

from gravcomp.commands import output
from gravcomp.commands.composition import add_composed_argument
from gravcomp.commands.folders import made_logs
from gravcomp.commands.live_page import add_page_arguments, show_page
from gravcomp.commands.parsers import namespace
from gravcomp.commands.virtual_seed import add_seed_argument, seed_of
from gravcomp.commands.virtual_tracker import add_tracker_argument, tracker_parameters

if TYPE_CHECKING:
    from gravcomp.description import RobotFile
    from gravcomp.launcher.host_client import NodeHost


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = "Start bridge, estimator, simulator and controller of a robot, until Ctrl-C. The motors are driven."
    parser.add_argument("robot", nargs="?", default="article", help="robot file or shipped robot (default: article)")
    parser.add_argument(
        "--interface",
        default="",
        help="python-can interface in place of the file's, e.g. socketcan (default with --virtual: a private bus)",
    )
    parser.add_argument(
        "--channel", default="", help="channel of the interface, e.g. can0; with several buses one each, by commas"
    )
    parser.add_argument("--virtual", action="store_true", help="start the virtual robot on the bus as well")
    add_tracker_argument(parser, "with --virtual: ")
    add_seed_argument(parser, "; with --virtual")
    parser.add_argument(
        "--namespace",
        type=namespace,
        default="",
        metavar="NS",
        help="namespace of all nodes, e.g. /left, for several robots in one graph",
    )
    add_composed_argument(parser)
    parser.add_argument("--viewer", action="store_true", help="show the robot in a browser")
    add_page_arguments(parser)
    parser.add_argument("--logs", metavar="DIR", help="folder for the nodes' output (default: a temporary one)")


def run(args: argparse.Namespace) -> int:
    """Run the graph until Ctrl-C (exit code 130). Raises ConfigError, LaunchError, NodeDied when a node ends by itself."""
    _check(args)  # before the host, which would import for nothing
    # Before the imports of the command: the host imports for the nodes at the same time.
    from gravcomp.launcher.host_client import NodeHost

    with NodeHost() as host:
        return _run(args, host)


def _check(args: argparse.Namespace) -> None:
    """Raise ConfigError for options that exclude each other, and for a bus among them whose device this machine lacks."""
    from gravcomp.config import ConfigError

    if args.tracker and not args.virtual:
        raise ConfigError("--tracker needs --virtual: a tracker of a real robot publishes measured/tip itself")
    if args.interface == "socketcan" and not set(args.channel.split(",")) <= {name for _, name in socket.if_nameindex()}:
        from gravcomp.description import load_robot_file

        _check_devices(load_robot_file(args.robot), args.interface, args.channel)


def _check_devices(file: "RobotFile", interface: str, channel: str) -> None:
    """Raise ConfigError for a device of the robot's buses that this machine lacks."""
    from gravcomp.canbus.device import check_device

    for bus in () if file.has_joints else file.hardware.on(interface, channel).all_buses:
        check_device(bus)


def _run(args: argparse.Namespace, host: "NodeHost") -> int:
    from gravcomp.commands.preparation import prepare
    from gravcomp.description import load_robot_file
    from gravcomp.launcher import Graph
    from gravcomp.launcher.robot_graph import RobotGraph, private_channels

    logs = made_logs(args.logs)
    builder = prepare(args.robot, args.virtual, seed_of(args))
    interface, channel, file = args.interface, args.channel, load_robot_file(args.robot)
    virtual = {"motion": "topic", **tracker_parameters(args)}
    if args.virtual and not (interface or channel):
        # On the bus of the robot file, several virtual robots on one machine would receive each other's frames.
        interface, channel = "udp_multicast", private_channels(args.robot)
        # Lower rates of ground truth and feedback than on hardware, to save CPU time for the loop.
        virtual |= {"truth_rate": 50.0, "feedback_rate": 125}
    if interface and not args.virtual:
        file.require_motors(interface)
    _check_devices(file, interface, channel)  # before the nodes, which start for seconds
    graph = RobotGraph(args.robot, interface, channel, args.namespace, seed=args.seed)
    specs = graph.loop(args.virtual, args.composed)
    if args.virtual:
        specs.append(graph.node("gravcomp_hw", "virtual_robot", **virtual))
    with builder, Graph(specs, logs, builder.environment, host) as processes:
        if args.viewer:
            processes.start_one(graph.node("gravcomp_fem", "viewer", port=args.port))
        begin = time.monotonic()
        processes.start()
        if args.viewer:
            show_page(processes, args.no_open)
        names = ", ".join(processes.processes)
        bus = f" Bus: {interface} {channel}." if interface or channel else ""
        output.note(f"Started: {names}.{bus} Their output: {processes.logs}. Ctrl-C ends them.")
        processes.wait(processes.were_active, float("inf"), "the activation of all nodes")
        builder.start()
        figures = {
            "nodes": list(processes.processes),
            "active_after_s": round(time.monotonic() - begin, 1),
            "interface": interface,
            "channel": channel,
            "logs": str(processes.logs),
        }
        output.result(figures, f"All nodes are active after {figures['active_after_s']:.1f} s.")
        while True:
            processes.check()
            time.sleep(0.2)
