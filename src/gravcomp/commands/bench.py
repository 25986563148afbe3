"""`gravcomp bench NAME`: the performance figures, measured here and now."""

import argparse
import importlib
import json
import sys
from pathlib import Path

from gravcomp.config import ConfigError

BENCHMARKS = {
    "engine": "model and inverse problem: accuracy against CalculiX, step times, dynamics",
    "estimator": "orientation on recorded data with optical truth, temperature control",
    "graph": "the running graph: delay and rates, the bridge's share of a core",
    "page": "the live page in a browser: how soon, how often, and what it costs the loop",
    "faults": "malformed frames and messages, faults, killed processes: what reaches the motors",
    "soak": "a long run: lost commands, growing memory",
}


OPTIONS = {
    "faults": {
        "kills": (20, "of each process"),
        "frames": (1_000_000, "malformed and hostile frames and messages"),
        "seed": (1, "of the campaign"),
    },
    "soak": {"minutes": (30.0, "to run")},
}
"""Keyword arguments of a benchmark's `run` that can be set: default and meaning."""

BRIEF = {
    "engine": {"every": 10},
    "estimator": {"every": 5},
    "graph": {"listen": 4.0, "cost": 4.0},
    "page": {"listen": 5.0},
    "faults": {"kills": 1, "frames": 10_000, "every": 6},
    "soak": {"minutes": 0.2},
}
"""The same under --brief."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments: those of each benchmark below its name."""
    parser.description = "Performance figures, measured on this machine."
    choices = parser.add_subparsers(dest="benchmark", required=True, metavar="NAME")
    for name, summary in BENCHMARKS.items():
        own = choices.add_parser(name, help=summary, description=summary)
        own.add_argument("--json", action="store_true", help="print the figures as one JSON object, the last line")
        own.add_argument(
            "--write", metavar="DOCUMENT", help="renew the table of figures in a Markdown document, between its marks"
        )
        own.add_argument("--brief", action="store_true", help="fewer and shorter runs, for a first look")
        for option, (default, meaning) in OPTIONS.get(name, {}).items():
            own.add_argument(f"--{option}", type=type(default), default=default, help=f"{meaning} (default {default})")


def run(args: argparse.Namespace) -> int:
    """Run the command; 0: measured."""
    from rich.console import Console

    from gravcomp.bench.limits import figures as told_first
    from gravcomp.report import figures_table

    command = f"bench {args.benchmark}"
    if args.write and args.brief:
        raise ConfigError("--write puts the figures of whole benchmarks into a document; --brief shortens them: give one of both")
    if args.write:
        figures_table.check_place(Path(args.write), command)
    module = importlib.import_module(f"gravcomp.bench.{args.benchmark}")
    options = BRIEF[args.benchmark] if args.brief else {name: getattr(args, name) for name in OPTIONS.get(args.benchmark, {})}
    console = Console(stderr=True)
    with console.status(command) as status:
        measured = module.run(lambda what: status.update(f"{command}: {what}"), **options)
    figures = told_first(args.benchmark, measured)
    _print_measured(command, measured)
    console.print(figures_table.rich_table(command, figures))
    if args.write:
        figures_table.renew(Path(args.write), command, figures)
    if args.json:
        print(json.dumps(measured), flush=True)
    return 0


def _print_measured(title: str, measured: dict) -> None:
    """Everything, by the keys of the JSON."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left", show_header=False)
    for key, value in measured.items():
        table.add_row(key, json.dumps(value, indent=1) if isinstance(value, dict) else str(value))
    Console(file=sys.stderr).print(table)
