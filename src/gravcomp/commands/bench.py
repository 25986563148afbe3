"""`gravcomp bench NAME`: the performance figures, measured here and now."""

import argparse
import importlib
import json
import sys

BENCHMARKS = {
    "engine": "model and inverse problem: accuracy against CalculiX, step times, dynamics",
    "estimator": "orientation on recorded data with optical truth, temperature control",
    "graph": "the running graph: delay and rates, the bridge's share of a core",
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


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments: those of each benchmark below its name."""
    parser.description = "Performance figures, measured on this machine."
    choices = parser.add_subparsers(dest="benchmark", required=True, metavar="NAME")
    for name, summary in BENCHMARKS.items():
        own = choices.add_parser(name, help=summary, description=summary)
        own.add_argument("--json", action="store_true", help="print the figures as one JSON object, the last line")
        for option, (default, meaning) in OPTIONS.get(name, {}).items():
            own.add_argument(f"--{option}", type=type(default), default=default, help=f"{meaning} (default {default})")


def run(args: argparse.Namespace) -> int:
    """Run the command; 0: measured."""
    from rich.console import Console

    module = importlib.import_module(f"gravcomp.bench.{args.benchmark}")
    options = {name: getattr(args, name) for name in OPTIONS.get(args.benchmark, {})}
    console = Console(stderr=True)
    with console.status(f"bench {args.benchmark}") as status:
        figures = module.run(lambda what: status.update(f"bench {args.benchmark}: {what}"), **options)
    _print_figures(args.benchmark, figures)
    if args.json:
        print(json.dumps(figures), flush=True)
    return 0


def _print_figures(name: str, figures: dict) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"bench {name}", title_justify="left", show_header=False)
    for key, value in figures.items():
        table.add_row(key, json.dumps(value, indent=1) if isinstance(value, dict) else str(value))
    Console(file=sys.stderr).print(table)
