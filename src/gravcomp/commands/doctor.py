"""`gravcomp doctor`: what is installed, what is missing, and the line that mends it; checks a YAML, a bus, a running graph."""

import argparse
import dataclasses
import json
import os
import sys


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = "What is installed here, what is missing, and the line that mends it."
    parser.add_argument("--robot", metavar="FILE", help="also check this robot's YAML")
    parser.add_argument("--interface", help="also listen to a bus for two seconds: python-can interface, e.g. socketcan")
    parser.add_argument("--channel", default="", help="its channel, e.g. can0")
    parser.add_argument("--graph", action="store_true", help="also look at the running graph: rates, delays, fitting QoS")
    parser.add_argument("--namespace", default="", help="of the running graph, e.g. /left")
    parser.add_argument("--json", action="store_true", help="print the findings as one JSON object, the last line")


def run(args: argparse.Namespace) -> int:
    """Run the command; 0: nothing needed is missing, 1: something is."""
    from gravcomp.doctor import bus, machine, robot_file, running_graph

    findings = machine.examine()
    if args.robot:
        findings += robot_file.examine(args.robot)
    if args.interface:
        findings += bus.examine(args.interface, args.channel)
    if args.graph:
        findings += running_graph.examine(args.namespace)
    _show(findings)
    if args.json:
        print(json.dumps({"findings": [dataclasses.asdict(f) for f in findings], "healthy": _healthy(findings)}), flush=True)
    return 0 if _healthy(findings) else 1


def _healthy(findings: list) -> bool:
    return not any(f.level == "missing" for f in findings)


def _show(findings: list) -> None:
    from rich.console import Console
    from rich.table import Table

    colours = {"ok": "green", "optional": "yellow", "missing": "red"}
    table = Table(show_header=False, box=None)
    for f in findings:
        table.add_row(f"[{colours[f.level]}]{f.level}[/]", f.subject, f.found, f.remedy)
    Console(file=sys.stderr, width=None if sys.stderr.isatty() else int(os.environ.get("COLUMNS", 160))).print(table)
