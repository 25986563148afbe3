"""`gravcomp arm`: move the virtual robot through five poses on a seven-axis arm, released and compensated."""

import argparse
import dataclasses
import json
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output
from gravcomp.commands.folders import made_logs
from gravcomp.commands.live_page import add_page_arguments, show_page
from gravcomp.commands.parsers import in_range, namespace

if TYPE_CHECKING:
    from rich.console import Group

    from gravcomp.launcher import Graph
    from gravcomp.launcher.host_client import NodeHost
    from gravcomp.launcher.node_process import NodeSpec

# s: on the first start on a machine Numba compiles.
_START_TIMEOUT = 300.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Example for larger arms: URDF of arm and robot, gravity from the IMU checked against the arm's joints, "
        "and the tip error at five poses with and without compensation."
    )
    parser.add_argument("--xacro", metavar="FILE", help="another seven-axis arm with the soft robot (default: the shipped one)")
    parser.add_argument(
        "--gravity",
        choices=("imu", "arm", "both", "fused"),
        default="both",
        help="from the IMU, from the arm's joints, from the IMU and checked against the joints, or from both together, with the"
        " arm's acceleration fed forward (default: both)",
    )
    parser.add_argument("--robot", default="article", help="robot file or shipped robot (default: article)")
    parser.add_argument(
        "--hold",
        type=in_range(float, 1.0, 600.0, "s"),
        default=5.0,
        metavar="S",
        help="time at each pose in seconds (default: 5)",
    )
    parser.add_argument(
        "--travel",
        type=in_range(float, 0.5, 600.0, "s"),
        default=3.0,
        metavar="S",
        help="time of each motion between two poses in seconds (default: 3)",
    )
    parser.add_argument("--viewer", action="store_true", help="show the robot in a browser")
    add_page_arguments(parser)
    parser.add_argument(
        "--namespace", type=namespace, default="", metavar="NS", help="namespace of all nodes, for one of several robots"
    )
    parser.add_argument("--logs", metavar="DIR", help="folder for the nodes' output (default: a temporary one)")


def run(args: argparse.Namespace) -> int:
    """Run the tour. Returns 0: completed. Raises ConfigError, LaunchError, NodeDied, TimeoutError."""
    given = _checked_arm(Path(args.xacro)) if args.xacro else None  # before the host, which would import for nothing
    # Before the imports of the command: the host imports for the nodes at the same time.
    from gravcomp.launcher.host_client import NodeHost

    with NodeHost() as host:
        return _run(args, given, host)


def _checked_arm(xacro: Path) -> str:
    """Return the URDF of an arm. Raises ConfigError for one that cannot be read, or does not carry the robot."""
    from gravcomp.arm.chain import Chain
    from gravcomp.arm.description import expanded

    described = expanded(xacro)
    Chain(described, "soft_base", "world", str(xacro))
    return described


def _run(args: argparse.Namespace, given: str | None, host: "NodeHost") -> int:
    from gravcomp.arm.description import expanded, shipped_xacro
    from gravcomp.commands.preparation import prepare
    from gravcomp.launcher import Graph
    from gravcomp.launcher.domain import private_domain
    from gravcomp.launcher.robot_graph import RobotGraph, private_channels

    given_logs = made_logs(args.logs)
    builder = prepare(args.robot, virtual=True)
    described = given or expanded(shipped_xacro("seven_axis_arm.urdf.xacro"))
    with tempfile.TemporaryDirectory(prefix="gravcomp-") as scratch:
        urdf, result = Path(scratch) / "arm.urdf", Path(scratch) / "result.json"
        urdf.write_text(described, encoding="utf-8")
        # Lower rates of ground truth and feedback than on hardware, to save CPU time for the loop.
        motion = {"motion": "topic", "truth_rate": 25.0, "feedback_rate": 125, **_start_of_tour(urdf)}
        graph = RobotGraph(args.robot, "udp_multicast", private_channels(args.robot), args.namespace, {"virtual_robot": motion})
        specs = [spec for spec in graph.loop(virtual=True) if args.gravity != "arm" or spec.executable != "imu_estimator"]
        if args.gravity == "fused":
            specs = [_fused(spec) if spec.executable == "imu_estimator" else spec for spec in specs]
        if args.gravity != "imu":
            use = {"arm": "publish", "both": "check", "fused": "fuse"}[args.gravity]
            fed = args.gravity == "fused"
            specs.append(graph.node("gravcomp_estimation", "arm_gravity", use=use, urdf=str(urdf), feed_acceleration=fed))
        specs.append(graph.node("gravcomp_hw", "virtual_robot"))
        stops = {"hold": args.hold, "travel": args.travel}
        player = graph.node("gravcomp_fem", "arm_player", urdf=str(urdf), result_file=str(result), **stops)
        logs, domain = given_logs or Path(scratch) / "logs", private_domain()
        with builder, Graph([*specs, player], logs, {**domain, **builder.environment}, host) as processes:
            if args.viewer:
                processes.start_one(graph.node("gravcomp_fem", "viewer", port=args.port))
            processes.start()
            if args.viewer:
                show_page(processes, args.no_open)
            output.note(f"Nodes started (ROS_DOMAIN_ID={domain['ROS_DOMAIN_ID']}), their output: {logs}")
            builder.start()
            figures = _follow(processes, result)
    output.result(figures, _summary(figures))
    return 0


def _fused(estimator: "NodeSpec") -> "NodeSpec":
    """Return the estimator whose gravity arm_gravity fuses with its own."""
    return dataclasses.replace(
        estimator,
        parameters={**estimator.parameters, "arm_acceleration": True},
        remappings={**estimator.remappings, "gravity": "gravity/imu"},
    )


def _start_of_tour(urdf: Path) -> dict:
    """Return the initial pose of the virtual robot's base: that of the arm, so that the robot is not jerked."""
    import math

    from gravcomp.arm.chain import Chain
    from gravcomp.arm.tour import FIVE_POSES

    chain = Chain(urdf.read_text(encoding="utf-8"), "soft_base", "world", str(urdf))
    last = list(FIVE_POSES.values())[-1]
    x, y, z = chain.gravity(dict(zip(chain.moving, last)))
    return {"inclination_deg": math.degrees(math.atan2(-z, math.hypot(x, y))), "roll_deg": math.degrees(math.atan2(y, -x))}


def _follow(processes: "Graph", result: Path) -> dict[str, Any]:
    """Wait until the tour is completed. Returns its figures. Raises NodeDied, TimeoutError."""
    phase, begin = "", time.monotonic()
    while True:
        # Read before the file: the player writes its result before it ends.
        dead = processes.dead()
        try:
            state = json.loads(result.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            state = {"phase": "starting"}
        if state["phase"] == "done":
            return state["figures"]
        if dead:
            processes.check()
        if state["phase"] != phase:
            phase, begin = state["phase"], time.monotonic()
            output.note(phase)
        if phase not in ("released", "compensated") and time.monotonic() - begin > _START_TIMEOUT:
            raise TimeoutError(f"the tour did not continue ({phase}); the nodes' output is in {processes.logs}")
        time.sleep(0.1)


def _summary(figures: dict[str, Any]) -> "Group":
    """Return the table of tip errors at the poses, with notes on the run."""
    from rich.console import Group
    from rich.table import Table

    table = Table(
        "inclination, deg",
        "released, mm",
        "compensated, mm",
        title="Virtual robot on a seven-axis arm: tip error",
        title_justify="left",
    )
    rows = zip(figures["inclination_deg"], figures["tip_error_released_mm"], figures["tip_error_compensated_mm"])
    for inclination, released, compensated in rows:
        table.add_row(f"{inclination:g}", f"{released:.2f}", f"{compensated:.2f}")
    table.add_row("RMS", f"{figures['tip_error_released_rms_mm']:.2f}", f"{figures['tip_error_compensated_rms_mm']:.2f}")
    disagreement = figures["arm_and_imu_disagree_by_deg"]
    agree = "" if disagreement is None else f"; at the poses arm and IMU disagree on gravity by at most {disagreement:g} deg"
    notes = [f"{figures['ratio']:g} times smaller with compensation{agree}"]
    if min(figures["followed_percent"].values()) < 100.0:
        shares = ", ".join(f"{name} {share:g} %" for name, share in figures["followed_percent"].items())
        notes.append(f"The bridge did not follow all the time ({shares} of the run): this machine was too busy")
    return Group(table, *notes)
