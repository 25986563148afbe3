"""`gravcomp bench NAME`: performance figures, measured on this machine."""

import argparse
import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output
from gravcomp.commands.parsers import add_subcommand, in_range

if TYPE_CHECKING:
    from rich.table import Table

BENCHMARKS = {
    "engine": "model and inverse problem: accuracy against CalculiX, step times, dynamics",
    "robots": "every robot's mesh, reduced model and times; the model against what others measured",
    "contact": "a robot that touches a scene: accuracy, penetration, energy, step times",
    "track": "a wrong model that a tracker of the tip corrects",
    "loads": "external wrenches against SoRoSim; unknown payloads and tip forces that the loop has to find",
    "estimator": "orientation on recordings with optical ground truth, temperature control",
    "streams": "faulty IMU streams: what is reported, what is held",
    "board": "the board's firmware: hostile frames, dead host, failed sensor, build",
    "graph": "the running graph: latency and rates, CPU load of the CAN bridge",
    "page": "the live page in a browser: time until it is shown, frame rate, load on the loop",
    "faults": "malformed frames and messages, faults, killed processes: the currents that reach the motors",
    "joints": "joint_bridge: malformed messages, and the loop through each kind of controller against CAN",
    "start": "the first and the second start in a new clone, start of the nodes, size of the environment",
    "soak": "a long run: lost commands, growing memory",
}


OPTIONS: dict[str, dict[str, tuple[float, str]]] = {
    "faults": {
        "kills": (20, "number of kills of each process"),
        "frames": (1_000_000, "number of malformed and hostile frames and messages"),
        "seed": (1, "seed of the random frames and faults"),
    },
    "board": {
        "frames": (200_000, "number of hostile frames and samples at the image and at the C code"),
        "seed": (1, "seed of the hostile frames"),
    },
    "joints": {
        "messages": (1_000_000, "number of malformed and hostile messages"),
        "seed": (1, "seed of the messages and of the virtual robot"),
    },
    "graph": {"composed": (False, "compare the delay with the inner nodes in one process with that as processes")},
    "robots": {
        "loop": (False, "measure the loop on each robot's virtual robot instead of its model"),
        "mesh": (False, "measure only the error of each robot's mesh and its shape without load"),
        "every": (1, "compute every N-th path of the closed loop, with N times fewer steps, and row of the references"),
        "again": (False, "measure again what was measured before with the same robots and the same program"),
    },
    "track": {"seeds": (3, "number of seeds of the virtual robot")},
    "loads": {"seeds": (3, "number of seeds of the virtual robot")},
    "streams": {"seed": (1, "seed of the faults"), "seeds": (2, "simulated recordings of each kind")},
    "soak": {"minutes": (30.0, "duration in minutes")},
    "start": {"tests": (False, "measure the tests, too")},
}
"""Keyword arguments of a benchmark's `run` that are options of the command: default and meaning."""

LEAST = {"seed": 0, "minutes": 0.01}
MOST = 2**31 - 1
"""What such a number is at least, where that is not 1, and at most."""

LISTS: dict[str, dict[str, tuple[str, str]]] = {
    "robots": {
        "files": ("FILE", "robot files or shipped robots (default: all shipped ones and those in ../shared/robots)"),
        "--figures": ("KEY", "only these figures, by their keys in --json"),
    },
    "track": {"files": ("FILE", "robot files or shipped robots (default: article)")},
    "loads": {"files": ("FILE", "robot files or shipped robots (default: article)")},
}
"""Keyword arguments of a benchmark's `run` that are lists of texts: positional, or an option."""

KINDS = ("loop", "mesh", "composed")
"""Options with which a benchmark measures something else, which has a table of its own."""

BRIEF: dict[str, dict[str, Any]] = {
    "engine": {"every": 50},
    "robots": {"every": 10},
    "contact": {"every": 39},
    "track": {"seeds": 1, "brief": True},
    "loads": {"seeds": 1, "rods": 3, "brief": True},
    "estimator": {"every": 39},
    "streams": {"every": 13, "seeds": 0},
    "board": {"frames": 10_000, "every": 5},
    "graph": {"listen": 1.0, "cost": 1.0, "warm_up": 0.2, "pairs": 1},
    "page": {"listen": 1.0, "settle": 0.2, "window": (500, 300)},
    "faults": {"kills": 1, "frames": 2_000, "every": 10, "stops": 1, "pause": 0.2},
    "joints": {"messages": 1_000, "orientations": 0, "loops": 1, "poses": 2},
    "start": {},
    "soak": {"minutes": 0.05},
}
"""Keyword arguments of a benchmark's `run` with --brief."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare a subcommand for each benchmark, with its options."""
    parser.description = "Performance figures, measured on this machine."
    choices = parser.add_subparsers(dest="benchmark", required=True, metavar="NAME")
    for name, summary in BENCHMARKS.items():
        own = add_subcommand(choices, name, summary)
        own.add_argument(
            "--write", metavar="DOCUMENT", help="update the table of figures in a Markdown document, between its markers"
        )
        own.add_argument("--brief", action="store_true", help="fewer and shorter runs, for a first look")
        for argument, (metavar, meaning) in LISTS.get(name, {}).items():
            own.add_argument(argument, nargs="*", default=[], metavar=metavar, help=meaning)
        for option, (default, meaning) in OPTIONS.get(name, {}).items():
            if default is False:
                own.add_argument(f"--{option}", action="store_true", help=meaning)
            else:
                kind = in_range(type(default), LEAST.get(option, 1), MOST)
                own.add_argument(f"--{option}", type=kind, default=default, help=f"{meaning} (default {default})")


def run(args: argparse.Namespace) -> int:
    """Run the benchmark. Returns 0: every figure with a limit reached it, 1: at least one missed it. Raises ConfigError."""
    from gravcomp.bench.limits import figures as headline_figures
    from gravcomp.config import ConfigError
    from gravcomp.description.robot_file import robot_path
    from gravcomp.report import figures_table

    other = next((f" --{name}" for name in KINDS if getattr(args, name, False)), "")
    command = f"bench {args.benchmark}{other}"
    if args.write and args.brief:
        raise ConfigError("--write and --brief exclude each other: a document takes the figures of whole benchmarks")
    if args.write:
        figures_table.check_place(Path(args.write), command)
    for name in getattr(args, "files", ()):
        robot_path(name)
    module = importlib.import_module(f"gravcomp.bench.{args.benchmark}")
    options = {name: getattr(args, name) for name in OPTIONS.get(args.benchmark, {})}
    options |= BRIEF[args.benchmark] if args.brief else {}
    options |= {name.lstrip("-"): getattr(args, name.lstrip("-")) for name in LISTS.get(args.benchmark, {})}
    with output.busy(command) as show:
        measured = module.run(lambda stage: show(f"{command}: {stage}"), **options)
    figures = headline_figures(args.benchmark, measured)
    output.console().print(_table_of_everything(command, measured))
    if args.write:
        figures_table.renew(Path(args.write), command, figures, typed=_typed(args, command))
    output.result(measured, figures_table.rich_table(command, figures))
    return 1 if any(figure.reached is False for figure in figures) else 0


def _typed(args: argparse.Namespace, command: str) -> str:
    """Return the command with the files, figures and options that were given, but without those that `command` has."""
    words = [command]
    for option, (default, _) in OPTIONS.get(args.benchmark, {}).items():
        given = getattr(args, option)
        if given != default and option not in (*KINDS, "again"):
            words += [f"--{option}"] if given is True else [f"--{option}", str(given)]
    for argument in LISTS.get(args.benchmark, {}):
        given = getattr(args, argument.lstrip("-"))
        words += [argument, *given] if given and argument.startswith("--") else given
    return " ".join(words)


def _table_of_everything(title: str, measured: dict[str, Any]) -> "Table":
    """Return all figures by their JSON keys, as a table for the terminal."""
    import json

    from rich.table import Table

    table = Table(title=title, title_justify="left", show_header=False)
    for key, value in measured.items():
        table.add_row(key, json.dumps(value, indent=1) if isinstance(value, dict) else str(value))
    return table
