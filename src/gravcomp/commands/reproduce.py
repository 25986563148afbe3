"""`gravcomp reproduce NAME`: one of the article's experiments, or `all`, with a report page, plots and JSON."""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.config import ConfigError
from gravcomp.experiments import EXPERIMENTS, experiment

if TYPE_CHECKING:
    from rich.console import Console

    from gravcomp.closed_loop.setup import Setup
    from gravcomp.report.result import Result


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    lines = "\n".join(f"  {name:<14}{summary}" for name, summary in EXPERIMENTS.items())
    parser.description = f"Reproduce the article's experiments on the virtual robot, or judge a recording of your own robot (--bag):\n\n{lines}\n  {'all':<14}all of them, with an index page"
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("name", choices=[*EXPERIMENTS, "all"], metavar="NAME", help="the experiment, or all")
    parser.add_argument("--out", metavar="DIR", default="reports", help="where pages and JSON go (default: reports)")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON, last line of the output")
    parser.add_argument("--robot", default="article", help="robot file or shipped robot (default: article)")
    parser.add_argument("--seed", type=int, help="of the virtual robot's noise (default: the robot file's)")
    parser.add_argument("--workers", type=int, help="processes for sweeps (default: one a core)")
    parser.add_argument("--dask", metavar="ADDRESS", help="Dask scheduler for sweeps, as tcp://host:8786")
    parser.add_argument(
        "--write", metavar="DOCUMENT", help="renew each experiment's table of figures in a Markdown document, between its marks"
    )
    parser.add_argument(
        "--bag", metavar="BAG", help="judge a recording of the graph on a robot of your own in place of the virtual robot (`gravcomp record`; with its"
        " measured tip as geometry_msgs/PoseStamped on measured/tip)")  # fmt: skip
    parser.add_argument(
        "--tip-topic", metavar="TOPIC", help="of the measured tip in the bag (default: measured/tip, else truth/tip)"
    )
    parser.add_argument("--brief", action="store_true", help="fewer and shorter runs, for a first look")


def run(args: argparse.Namespace) -> int:
    """Run the command; 0: every figure with a limit reached, 1: at least one missed. Raises ConfigError."""
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from gravcomp.closed_loop.setup import Setup
    from gravcomp.commands.model.build import prepare_model
    from gravcomp.description import load_robot_file
    from gravcomp.report import figures_table
    from gravcomp.report.page import write_index, write_report
    from gravcomp.sweep import Sweep
    from gravcomp.trials.context import Context

    names = list(EXPERIMENTS) if args.name == "all" else [args.name]
    if args.write and args.bag:
        raise ConfigError("--write puts the virtual robot's figures into a document; --bag judges another's: give one of both")
    if args.write:
        if args.brief:
            raise ConfigError(
                "--write puts the figures of whole experiments into a document; --brief shortens them: give one of both"
            )
        for name in names:
            figures_table.check_place(Path(args.write), f"reproduce {name}")
    folder = Path(args.out).expanduser()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"--out is {folder}: cannot be made: {error.strerror}") from error
    file = load_robot_file(args.robot)
    console = Console(stderr=True)
    if args.bag:
        return _judge(args, Setup.of(file), folder, console)
    prepare_model(args.robot)
    results = []
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Sweep(args.workers, args.dask) as sweep, Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("starting")
        label = ""
        context = Context(
            Setup.of(file, args.seed),
            sweep,
            lambda sentence: progress.update(task, description=f"{label}: {sentence}"),
            args.brief,
        )
        for name in names:
            label = name
            started = time.perf_counter()
            result = experiment(name).run(context)
            result.seconds = time.perf_counter() - started
            result.parameters.setdefault("seed", context.setup.seed)
            result.parameters.update({"robot": context.setup.source, "sweeps": sweep.place})
            if args.brief:
                result.notes.insert(0, "Run with --brief: fewer and shorter runs than the article's experiment.")
            page = write_report(result, folder)
            results.append(result)
            console.print(figures_table.rich_table(f"{result.title}  ({result.seconds:.0f} s)", result.figures))
            console.print(f"[dim]{page}[/dim]\n")
            if args.write:
                figures_table.renew(Path(args.write), f"reproduce {name}", result.figures)
        if len(results) > 1:
            console.print(f"[bold]index[/bold]  {write_index(results, folder)}")
    return _end(args, results)


def _judge(args: argparse.Namespace, setup: Setup, folder: Path, console: Console) -> int:
    """The recorded robot in place of the virtual one. Raises ConfigError; with `all`, what the bag cannot tell is only said."""
    from gravcomp.evaluation.recorded import JUDGES, judge
    from gravcomp.evaluation.recorded.run import RecordedRun
    from gravcomp.report import figures_table
    from gravcomp.report.page import write_report

    recorded = RecordedRun(Path(args.bag).expanduser(), setup, args.tip_topic)
    # One name for each way of judging.
    names = list({module: name for name, module in reversed(JUDGES.items())}.values()) if args.name == "all" else [args.name]
    results = []
    for name in names:
        started = time.perf_counter()
        try:
            result = judge(name).run(recorded)
        except ConfigError as error:
            if args.name != "all":
                raise
            console.print(f"{name}: {error}", highlight=False)
            continue
        result.name, result.bag, result.seconds = name, args.bag, time.perf_counter() - started
        result.parameters["robot"] = setup.source
        console.print(figures_table.rich_table(result.title, result.figures))
        console.print(f"[dim]{write_report(result, folder)}[/dim]\n")
        results.append(result)
    if not results:
        raise ConfigError(f"{args.bag}: nothing of it can be judged")
    return _end(args, results)


def _end(args: argparse.Namespace, results: list[Result]) -> int:
    if args.json:
        document = {"experiments": [result.to_mapping() for result in results], "reached": all(r.reached for r in results)}
        print(json.dumps(document))
        sys.stdout.flush()
    return 0 if all(result.reached for result in results) else 1
