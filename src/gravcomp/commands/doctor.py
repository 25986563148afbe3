"""`gravcomp doctor`: what is installed and what is missing, with the command that installs it.

On request it also checks a robot file, a CAN bus and the running graph.
"""

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.commands import output
from gravcomp.commands.folders import made_folder
from gravcomp.commands.parsers import namespace

if TYPE_CHECKING:
    from rich.table import Table

    from gravcomp.doctor.finding import Finding


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = "Print what is installed, what is missing, and the command that installs it."
    parser.add_argument("--robot", metavar="FILE", help="also check this robot file")
    parser.add_argument("--interface", help="also listen to a CAN bus for two seconds: python-can interface, e.g. socketcan")
    parser.add_argument("--channel", default="", help="channel of that bus, e.g. can0; several by commas")
    parser.add_argument(
        "--board", action="store_true", help="also run the bench test of the board on that bus, 15 s; motors without power"
    )
    parser.add_argument(
        "--motor", type=int, metavar="N", help="with --board: also a current step of the motor with this CAN id; unhook its cable"
    )
    parser.add_argument("--current", type=float, default=0.2, metavar="A", help="current of that step (default: 0.2)")
    parser.add_argument("--out", metavar="DIR", help="with --board: write the report page board.html into this folder")
    parser.add_argument("--graph", action="store_true", help="also check the running graph: rates, latencies, matching QoS")
    parser.add_argument(
        "--namespace", type=namespace, default="", metavar="NS", help="namespace of the running graph, e.g. /left"
    )


def run(args: argparse.Namespace) -> int:
    """Run the checks. Returns 0: nothing required is missing, 1: something is. Raises ConfigError."""
    from gravcomp import __version__
    from gravcomp.config import ConfigError
    from gravcomp.doctor import board, board_page, bus, machine, robot_file, running_graph

    findings = machine.examine()
    if args.robot:
        findings += robot_file.examine(args.robot)
    if args.interface:
        for channel in args.channel.split(","):
            findings += bus.examine(args.interface, channel.strip())
    if (args.motor is not None or args.out) and not args.board:
        raise ConfigError("--motor and --out belong to the bench test of a board: --board")
    if args.board and not args.interface:
        raise ConfigError("--board needs the bus of the board: --interface and --channel")
    if args.board:
        folder = made_folder("--out", Path(args.out).expanduser()) if args.out else None
        channel = args.channel.split(",")[0].strip()
        found = board.examine(args.interface, channel, motor=args.motor, current=args.current)
        findings += found
        if folder:
            page = board_page.write_page(found, args.interface, channel, folder)
            output.note(f"The page of the bench test is {page}")
    if args.graph:
        findings += running_graph.examine(args.namespace)
    healthy = not any(finding.level == "missing" for finding in findings)
    listed = [dataclasses.asdict(finding) for finding in findings]
    output.result({"version": __version__, "findings": listed, "healthy": healthy}, _table(findings))
    return 0 if healthy else 1


def _table(findings: "list[Finding]") -> "Table":
    from rich.markup import escape
    from rich.table import Table

    colours = {"ok": "green", "optional": "yellow", "missing": "red"}
    table = Table(show_header=False, box=None)
    for finding in findings:
        texts = (escape(text) for text in (finding.subject, finding.found, finding.remedy))
        table.add_row(f"[{colours[finding.level]}]{finding.level}[/]", *texts)
    return table
