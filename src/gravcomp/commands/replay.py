"""`gravcomp replay BAG`: run the graph on a recorded IMU stream, at any speed, with /clock."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.commands import output
from gravcomp.commands.folders import made_folder, made_logs
from gravcomp.commands.imu_topic import add_imu_topic, imu_topic
from gravcomp.commands.live_page import add_page_arguments, show_page
from gravcomp.commands.parsers import namespace

if TYPE_CHECKING:
    from gravcomp.launcher import Graph
    from gravcomp.launcher.host_client import NodeHost

# s: on the first start on a machine Numba compiles.
_START_TIMEOUT = 300.0
# s for the graph to process the last samples.
_SETTLE = 1.0
# Topics of the estimator of which a recorded replay must not lose a message, and the length of their queues.
_ESTIMATES, _KEPT = ("gravity", "imu/data", "imu/bias"), 1000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Play a recorded IMU stream into estimator, simulator and controller. "
        "A truncated or damaged bag is read as far as possible."
    )
    parser.add_argument(
        "bag", metavar="BAG", help="a rosbag2 folder (MCAP or SQLite), its file, an .npz file in BROAD's layout, or CSV"
    )
    parser.add_argument(
        "--speed",
        type=float,
        default=1.0,
        metavar="X",
        help="factor to real time (default: 1); 0: as fast as the graph processes it",
    )
    add_imu_topic(parser)
    parser.add_argument("--robot", default="article", help="robot file or shipped robot (default: article)")
    parser.add_argument("--out", metavar="DIR", help="record the output of the graph into a new bag")
    parser.add_argument("--viewer", action="store_true", help="show the robot in a browser")
    add_page_arguments(parser)
    parser.add_argument("--namespace", type=namespace, default="", metavar="NS", help="namespace of all nodes")
    parser.add_argument("--logs", metavar="DIR", help="folder for the nodes' output (default: a temporary one)")


def run(args: argparse.Namespace) -> int:
    """Replay. Returns 0: played to the end. Raises ConfigError, LaunchError, NodeDied, TimeoutError."""
    # Before the imports of the command: the host imports for the nodes at the same time.
    from gravcomp.launcher.host_client import NodeHost

    with NodeHost() as host:
        return _run(args, host)


def _run(args: argparse.Namespace, host: "NodeHost") -> int:
    from gravcomp.commands.preparation import prepare
    from gravcomp.commands.record import describe
    from gravcomp.config import ConfigError
    from gravcomp.launcher import Graph
    from gravcomp.launcher.robot_graph import RobotGraph
    from gravcomp.recordings.imu import read_recording

    if not 0.0 <= args.speed <= 1000.0:
        raise ConfigError(f"--speed is {args.speed:g}; allowed: 0 (as fast as the graph processes it) to 1000")
    if args.out and Path(args.out).exists():
        raise ConfigError(f"{args.out}: exists and is not overwritten; name another folder")
    if args.out:
        made_folder("--out", Path(args.out).parent)
    logs = made_logs(args.logs)
    bag = _whole(args.bag)
    topic = imu_topic(args)
    with output.progress(f"reading {args.bag}") as progress:
        recording = read_recording(bag, topic, progress=progress)
    for note in recording.notes:
        output.note(f"{args.bag}: {note}")
    builder = prepare(args.robot, virtual=False)
    graph = RobotGraph(args.robot, namespace=args.namespace)
    specs = [
        graph.node("gravcomp_estimation", "imu_estimator", use_sim_time=True, **(_lossless(args.namespace) if args.out else {})),
        graph.node("gravcomp_fem", "fem_simulator", use_sim_time=True),
        graph.node("gravcomp_fem", "inverse_controller", use_sim_time=True),
    ]
    viewer = [graph.node("gravcomp_fem", "viewer", port=args.port)] if args.viewer else []
    if args.out:
        specs.append(graph.node("gravcomp_fem", "recorder", out=str(Path(args.out).resolve())))
    replay = graph.node(
        "gravcomp_estimation", "imu_replay", file=str(Path(bag).resolve()), rate=args.speed, topic=topic or "",
        wait_for=[spec.executable for spec in (*viewer, *specs)], wait_for_subscribers=_START_TIMEOUT)  # fmt: skip
    begin = time.monotonic()
    with builder, Graph([*specs, replay], logs, builder.environment, host) as processes:
        if viewer:
            processes.start_one(viewer[0])
        processes.start()
        if viewer:
            show_page(processes, args.no_open)
        builder.start()
        _follow(processes, replay.name, recording.duration, args.speed)
        time.sleep(_SETTLE)
    figures = {
        "source": str(args.bag), "samples": len(recording), "duration_s": recording.duration, "speed": args.speed,
        "elapsed_s": round(time.monotonic() - begin, 2)}  # fmt: skip
    if args.out:
        figures["recorded"] = describe(Path(args.out))
    output.result(figures, f"{figures['source']}: {figures['samples']} samples, {figures['duration_s']:.1f} s, played to the end")
    return 0


def _lossless(namespace: str) -> dict:
    """Return parameters with which every message of the estimator is recorded: two replays of a bag then give equal bags."""
    prefix = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
    wanted = {"reliability": "reliable", "depth": _KEPT}
    return {f"qos_overrides.{prefix}/{topic}.publisher.{key}": value for topic in _ESTIMATES for key, value in wanted.items()}


def _whole(path: str) -> str:
    """Return the path itself, or that of the readable part of a damaged bag."""
    from gravcomp.recordings.bags.recovery import readable
    from gravcomp.recordings.imu import is_csv

    if Path(path).suffix == ".npz" or is_csv(Path(path)):
        return path
    with output.progress(f"checking {path}") as progress:
        bag = readable(path, progress)
    if bag.problem:
        output.note(f"{path}: damaged ({bag.problem}); {bag.messages} messages could be read")
    return str(bag.path)


def _follow(processes: "Graph", replay: str, duration: float, speed: float) -> None:
    """Show progress until the replay has ended. Raises NodeDied when a node fails."""
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with output.display(*columns) as progress:
        task = progress.add_task("starting", total=duration / speed if speed else None)
        log, started = processes.processes[replay].log, None
        while processes.processes[replay].exit_code is None:
            others = {name: why for name, why in processes.dead().items() if name != replay}
            if others:
                processes.check()
            if started is None and "playing" in log.read_text(errors="replace", encoding="utf-8"):
                started = time.monotonic()
                progress.update(task, description="playing")
            if started is not None:
                progress.update(task, completed=time.monotonic() - started)
            time.sleep(0.1)
        if processes.processes[replay].exit_code:
            processes.check()
