"""`gravcomp demo`: run the loop on a virtual robot: it sags, is compensated and tilted; print the figures of the run."""

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from gravcomp.commands import output
from gravcomp.commands.composition import add_composed_argument
from gravcomp.commands.folders import made_logs
from gravcomp.commands.live_page import add_page_arguments, show_page
from gravcomp.commands.virtual_seed import add_seed_argument, seed_of
from gravcomp.commands.virtual_tracker import add_tracker_argument, tracker_parameters

if TYPE_CHECKING:
    from rich.table import Table

    from gravcomp.commands.page_pictures import PagePictures
    from gravcomp.launcher import Graph
    from gravcomp.launcher.host_client import NodeHost

_SHORTEST = 10.0  # s: a shorter run shows neither sag nor compensation
_TURNING = 0.2  # rad/s: above the rate of a hand at rest plus the gyroscope's bias
_START_TIMEOUT = 300.0  # s: on the first start on a machine Numba compiles
_LONGEST_LOOKED_BACK = 3000.0  # s
_BROWSER_TIME = 200.0  # s from the end of the run until a browser shows the page, at most


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    from gravcomp.graph.boards import BOARDS

    parser.description = (
        "Run the four nodes, a virtual robot on a private CAN bus and the viewer as processes; print the figures of the run."
    )
    parser.add_argument(
        "--duration", type=float, default=30.0, metavar="S", help="duration in seconds (default: 30, at least 10)"
    )
    parser.add_argument("--headless", action="store_true", help="start no viewer")
    parser.add_argument(
        "--imu", metavar="FILE", help="a recorded IMU stream with ground truth: .npz in BROAD's layout or a rosbag2 folder"
    )
    parser.add_argument("--robot", default="article", help="robot file or shipped robot (default: article)")
    parser.add_argument(
        "--board",
        default="virtual",
        choices=BOARDS,
        help="board of the virtual robot: virtual, Python code (default); emulated, the firmware's C code between the host's bus"
        " and the motors; or standalone, that with the loop on the board, which compensates while the nodes only listen",
    )
    add_composed_argument(parser)
    add_tracker_argument(parser)
    add_seed_argument(parser)
    add_page_arguments(parser)
    parser.add_argument(
        "--screenshots",
        metavar="DIR",
        help="take pictures of the page with Chromium after the run: sagging, compensated and tilted",
    )
    parser.add_argument("--logs", metavar="DIR", help="folder for the nodes' output (default: a temporary one)")


def run(args: argparse.Namespace) -> int:
    """Run the demo. Returns 0: completed. Raises ConfigError, LaunchError, NodeDied, TimeoutError."""
    _check(args)  # before the host, which would import for nothing
    # Before the imports of the command: the host imports for the nodes at the same time.
    from gravcomp.launcher.host_client import NodeHost

    with NodeHost() as host:
        return _run(args, host)


def _run(args: argparse.Namespace, host: "NodeHost") -> int:
    from gravcomp.commands.page_pictures import PagePictures
    from gravcomp.commands.preparation import prepare
    from gravcomp.config import ConfigError
    from gravcomp.description import load_robot_file
    from gravcomp.launcher import Graph
    from gravcomp.launcher.domain import private_domain
    from gravcomp.launcher.robot_graph import RobotGraph, private_channels
    from gravcomp.virtual.described import described

    given_logs = made_logs(args.logs)
    times = _Times.of(args)
    parameters: dict[str, dict] = {"virtual_robot": _motion(args, times)}
    pictures = PagePictures(Path(args.screenshots), times.of_pictures()) if args.screenshots else None
    builder = prepare(args.robot, virtual=True, seed=seed_of(args))
    channels = private_channels(args.robot)
    alone = args.board == "standalone"
    if args.board != "virtual":
        output.note(f"The board is on the bus `--interface udp_multicast --channel {channels.split(',')[0]}`")
    if alone:
        _prepare_alone(args.robot)
        parameters["fem_simulator"] = {"cables_from": "state"}  # the model follows the motors that the board drives
    graph = RobotGraph(args.robot, "udp_multicast", channels, parameters=parameters, seed=args.seed)
    loop = graph.loop(virtual=True, composed=args.composed)
    nodes = [spec.executable for spec in graph.loop(virtual=True)] + ["virtual_robot"]
    with tempfile.TemporaryDirectory(prefix="gravcomp-") as scratch:
        result_file = Path(scratch) / "result.json"
        judge = graph.node(
            "gravcomp_hw", "judge", duration=args.duration, relax_time=times.relaxed, settle_time=min(4.0, 0.15 * args.duration),
            start_timeout=_START_TIMEOUT, result_file=str(result_file), nodes=nodes, standalone=alone, measure_delay=not alone,
        )  # fmt: skip
        specs = [*loop, judge]
        pictured = {"look_back": args.duration + _BROWSER_TIME, "graphics": "full"} if args.screenshots else {}
        logs = given_logs or Path(scratch) / "logs"
        domain = private_domain()
        with builder, Graph(specs, logs, {**domain, **builder.environment}, host) as processes:
            if not args.headless:
                processes.start_one(graph.node("gravcomp_fem", "viewer", port=args.port, **pictured))
            processes.start()
            # It becomes active as the last one, because its motion begins then.
            virtual_robot = processes.start_one(graph.node("gravcomp_hw", "virtual_robot"), gated=True)
            if not args.headless:
                address = show_page(processes, args.no_open)
            output.note(f"Nodes started (ROS_DOMAIN_ID={domain['ROS_DOMAIN_ID']}), their output: {logs}")
            processes.wait(processes.were_active, _START_TIMEOUT, "the activation of all nodes")
            virtual_robot.open_gate()
            processes.wait(processes.were_active, _START_TIMEOUT, "the activation of the virtual robot")
            builder.start()
            state = _follow(processes, result_file, args, pictures)
            unfinished = builder.builds
            if pictures:
                processes.stop_except("viewer")  # it looks back; the others would take the processors that draw the pictures
            problem = pictures.take(address) if pictures else ""
            figures = {
                **state["figures"],
                "overloaded": _overloaded(state["figures"]),
                "nodes": state["nodes"],
                "board": args.board,
                "seed": described(load_robot_file(args.robot), args.seed).seed,
                "source": (args.imu and Path(args.imu).name) or "scenario: sag, compensate, tilt",
            }
    output.result(figures, _summary(figures))
    if figures["overloaded"]:
        output.note(figures["overloaded"])
    if unfinished and figures["full_model_pct"]:
        output.note(
            f"The full model served {figures['full_model_pct']:g} % of the evaluated time, more slowly, because the reduced model"
            " is not built yet. Its build in the background ended with the demo, and what it has computed is kept. Next time:"
            f" ./gravcomp model build {args.robot}, which goes on from there, then the demo again"
        )
    if problem:
        raise ConfigError(problem)
    return 0


def _check(args: argparse.Namespace) -> None:
    """Raise ConfigError for options that cannot be, or not together."""
    from gravcomp.config import ConfigError

    if not _SHORTEST <= args.duration <= 86400.0:
        raise ConfigError(f"--duration is {args.duration:g}; allowed: {_SHORTEST:g} to 86400 s")
    if args.screenshots and args.headless:
        raise ConfigError("--screenshots and --headless exclude each other: the pictures show the page")
    if args.screenshots and args.duration > _LONGEST_LOOKED_BACK:
        raise ConfigError(
            f"--screenshots looks back over the run: --duration is {args.duration:g}; allowed: up to {_LONGEST_LOOKED_BACK:g} s"
        )


class _Times(NamedTuple):
    """Times of the scenario in s from its begin: cables released until, base at rest until, end; begin: in the recording."""

    relaxed: float
    at_rest: float
    end: float
    begin: float

    @classmethod
    def of(cls, args: argparse.Namespace) -> "_Times":
        """Return the times of the options. Raises ConfigError for a recording that cannot be used."""
        relaxed = min(8.0, 0.3 * args.duration)
        begin = max(0.0, _begin_of_motion(args.imu) - relaxed) if args.imu else 0.0
        return cls(relaxed, relaxed + 0.45 * (args.duration - relaxed), args.duration, begin)

    def of_pictures(self) -> dict[str, float]:
        """Return the name and the moment of each picture."""
        compensated = self.relaxed + 0.75 * (self.at_rest - self.relaxed)
        return {"sagging": 0.9 * self.relaxed, "compensated": compensated, "tilted": 0.95 * self.end}


def _motion(args: argparse.Namespace, times: _Times) -> dict[str, Any]:
    """Return the parameters of virtual_robot. Raises ConfigError for a tracker that it cannot have."""
    # Lower rates of ground truth and feedback than on hardware, to save CPU time for the loop.
    given = {"truth_rate": 50.0, "feedback_rate": 125, "steerable": True, "board": args.board} | tracker_parameters(args)
    if args.imu:
        return given | {"motion": "recording", "recording": str(Path(args.imu).resolve()), "recording_start": times.begin}
    return given | {"motion": "tilt", "hold": times.at_rest}


def _prepare_alone(robot: str) -> None:
    """Make the model of the loop on the board, before any process starts. Raises ConfigError for a robot that has none."""
    from gravcomp.commands.model.build import prepare
    from gravcomp.config import ConfigError
    from gravcomp.description import load_robot_file
    from gravcomp.firmware.model_fit import blob_for
    from gravcomp.firmware.model_settings import LoopParameters

    file = load_robot_file(robot)
    if file.has_joints:
        raise ConfigError(f"{robot}: --board standalone needs motors on the board's bus; this robot has hardware.joints")
    parameters = LoopParameters.of(file)
    prepare(robot)
    with output.busy("choosing the modes for the board, once for this robot"):
        blob_for(parameters)


def _begin_of_motion(path: str) -> float:
    """Return the time (s) in the recording at which rotation begins; the rest before it is shortened to the time of sagging."""
    import numpy as np

    from gravcomp.config import ConfigError
    from gravcomp.recordings.imu import read_recording

    recording = read_recording(path)
    if recording.orientation is None:
        raise ConfigError(
            f"{path}: has no ground truth of the orientation, which the virtual robot's base needs to turn like the recorded one"
        )
    turning = np.linalg.norm(recording.gyro, axis=1) > _TURNING
    return float(recording.stamp_ns[np.argmax(turning)] - recording.stamp_ns[0]) * 1e-9


def _read(path: Path) -> dict:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def _follow(
    processes: "Graph", result_file: Path, args: argparse.Namespace, pictures: "PagePictures | None" = None
) -> dict[str, Any]:
    """Show progress until the node `judge` has evaluated the run. Returns its last state. Raises NodeDied, TimeoutError."""
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<22}"), BarColumn(), TimeElapsedColumn(), TextColumn("{task.fields[note]}"))
    deadline = time.monotonic() + args.duration + _START_TIMEOUT
    with output.display(*columns) as progress:
        task = progress.add_task("starting", total=args.duration, note="")
        phase = ""
        while True:
            state = _read(result_file)
            if state.get("phase") == "done":
                processes.wait(lambda: "judge" in processes.dead(), 10.0, "the judge's end")
                return state
            dead = processes.dead()
            if dead:
                # The judge may have written its result and ended since.
                state = _read(result_file)
                if set(dead) == {"judge"} and state.get("phase") == "done":
                    return state
                processes.check()
            if state.get("phase") and state["phase"] != phase:
                phase = state["phase"]
                progress.console.print(f"{state['elapsed']:5.1f} s  {phase}")
            if pictures:
                age = time.time() - state.get("time", time.time())  # the state may have been written half a second ago
                pictures.follow(state.get("elapsed", 0.0), time.monotonic() - age)
            error = state.get("tip_error_mm")
            note = "" if error is None else f"tip error {error:5.1f} mm"
            progress.update(task, description=phase, completed=state.get("elapsed", 0.0), note=note)
            if time.monotonic() > deadline:
                raise TimeoutError(f"the run did not end; the nodes' output is in {processes.logs}")
            time.sleep(0.2)


def _overloaded(figures: dict[str, Any]) -> str | None:
    """Return why the judge's figures are those of an overloaded machine; None where it kept up."""
    from gravcomp.evaluation.overload import overload

    delay = figures["delay_ms"] and 1e-3 * figures["delay_ms"]["median"]
    return overload(figures["imu_rate_hz"], figures["command_rate_hz"], delay)


def _summary(figures: dict[str, Any]) -> "Table":
    from rich.table import Table

    delay = figures["delay_ms"] or {"median": None, "p99": None}
    table = Table(title=f"Virtual robot, {figures['source']}", title_justify="left", show_header=False)
    rows = [
        ("sag without compensation", figures["sag_mm"], "mm"),
        ("tip error with compensation: lateral", figures["residual_lateral_mm"], "mm RMS"),
        ("tip error with compensation: axial", figures["residual_axial_mm"], "mm RMS"),
        (
            "tip error with / without, same motion",
            f"{figures['tip_error_with_mm']} / {figures['tip_error_without_mm']}",
            "mm RMS",
        ),
        ("lateral, base at rest / turning", f"{figures['held_lateral_mm']} / {figures['moving_lateral_mm']}", "mm RMS"),
        (
            "the same, of the tip error without compensation",
            f"{figures['held_lateral_pct']} / {figures['moving_lateral_pct']}",
            "%",
        ),
        ("settled after", figures["settle_s"], "s"),
        ("correlation of model and ground truth", figures["correlation"], ""),
        ("error of gravity", figures["gravity_error_deg"], "deg RMS"),
        ("time served by the full model", figures["full_model_pct"], "%"),
        *(
            [("IMU rate", figures["imu_rate_hz"], "Hz")]
            if figures["board"] == "standalone"
            else [
                ("IMU / command rate", f"{figures['imu_rate_hz']} / {figures['command_rate_hz']}", "Hz"),
                ("delay, IMU to motor current, median / p99", f"{delay['median']} / {delay['p99']}", "ms"),
            ]
        ),
        ("nodes", ", ".join(f"{name} {state}" for name, state in figures["nodes"].items()), ""),
    ]
    for name, value, unit in rows:
        table.add_row(name, f"{value} {unit}".strip())
    return table
