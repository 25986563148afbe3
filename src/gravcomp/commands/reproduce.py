"""`gravcomp reproduce NAME`: run one of the article's experiments, or `all`; writes a report page with plots, and JSON."""

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output
from gravcomp.commands.folders import made_folder
from gravcomp.commands.virtual_seed import add_seed_argument, seed_of
from gravcomp.experiments import ALSO, EXPERIMENTS, MEASURED, experiment

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import RenderableType

    from gravcomp.closed_loop.setup import Setup
    from gravcomp.report.result import Result


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    other = {name: also for also, name in ALSO.items()}
    lines = "\n".join(
        f"  {name:<14}{summary}" + (f" (also: {other[name]})" if name in other else "") for name, summary in EXPERIMENTS.items()
    )
    parser.description = (
        "Reproduce the article's experiments on the virtual robot, or evaluate a recording of your own robot (--bag):"
        f"\n\n{lines}\n  {'all':<14}all of them, with an index page\n  {'measured':<14}{MEASURED}"
    )
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument(
        "name",
        choices=[*EXPERIMENTS, *ALSO, "all", "measured"],
        metavar="NAME",
        help="name of the experiment, all or measured",
    )
    parser.add_argument(
        "data",
        nargs="?",
        metavar="DATA",
        help="with measured: folder of the measurements (default: GRAVCOMP_DATA, else ../shared/data)",
    )
    parser.add_argument("--out", metavar="DIR", default="reports", help="folder for the pages and JSON (default: reports)")
    parser.add_argument("--robot", default="article", help="robot file or shipped robot (default: article)")
    add_seed_argument(parser)
    parser.add_argument(
        "--workers", type=int, metavar="N", help="number of processes for sweeps (default: one per core; with --brief: one)"
    )
    parser.add_argument("--dask", metavar="ADDRESS", help="Dask scheduler for sweeps, as tcp://host:8786")
    parser.add_argument(
        "--write",
        metavar="DOCUMENT",
        help="update each experiment's table of figures in a Markdown document, between its markers",
    )
    parser.add_argument(
        "--bag",
        metavar="BAG",
        help="evaluate a recording of your own robot in place of the virtual robot (`gravcomp record`; with the measured tip"
        " as geometry_msgs/PoseStamped on measured/tip)",
    )
    parser.add_argument(
        "--tip-topic", metavar="TOPIC", help="topic of the measured tip in the bag (default: measured/tip, else truth/tip)"
    )
    parser.add_argument("--brief", action="store_true", help="fewer and shorter runs, for a first look")


def run(args: argparse.Namespace) -> int:
    """Run the experiments. Returns 0: every figure with a limit reached it, 1: at least one missed it. Raises ConfigError."""
    from gravcomp.closed_loop.setup import Setup
    from gravcomp.commands.model.build import prepare_model
    from gravcomp.config import ConfigError
    from gravcomp.description import load_robot_file
    from gravcomp.report import figures_table
    from gravcomp.report.page import write_index, write_report
    from gravcomp.sweep import Sweep
    from gravcomp.trials.context import Context

    args.name = ALSO.get(args.name, args.name)
    names = list(EXPERIMENTS) if args.name == "all" else [args.name]
    if args.data and args.name != "measured":
        raise ConfigError(f"DATA is {args.data}: only measured takes a folder of measurements, {args.name} does not")
    if args.bag and args.name == "measured":
        raise ConfigError("--bag does not apply to measured, which evaluates the measurements in DATA")
    if args.write and args.bag:
        raise ConfigError("--write and --bag exclude each other: a document takes the figures of the virtual robot")
    if args.write and args.brief:
        raise ConfigError("--write and --brief exclude each other: a document takes the figures of whole experiments")
    if args.write:
        for name in names:
            figures_table.check_place(Path(args.write), f"reproduce {name}")
    folder = made_folder("--out", Path(args.out).expanduser())
    if args.name == "measured":
        return _measured(args, folder)
    file = load_robot_file(args.robot)
    if args.bag:
        return _evaluate_bag(args, Setup.of(file), folder)
    setup = Setup.of(file, seed_of(args))
    output.note(setup.true_robot.summary())
    prepare_model(args.robot)
    results, pages = [], []
    # Processes take longer to start than the runs of a brief experiment take.
    workers = 1 if args.brief and args.workers is None else args.workers
    with Sweep(workers, args.dask) as sweep, output.stages("starting") as show:
        label = ""
        context = Context(
            setup,
            sweep,
            lambda stage: show(f"{label}: {stage}"),
            args.brief,
        )
        for name in names:
            label = name
            started = time.perf_counter()
            result = _unless_left_out(experiment, name, context, args.name == "all")
            if result is None:
                continue
            result.seconds = time.perf_counter() - started
            result.parameters.setdefault("seed", context.setup.seed)
            result.parameters.update({"robot": context.setup.source, "sweeps": sweep.place})
            if args.brief:
                result.notes.insert(
                    0, "Run with --brief: fewer and shorter runs than the article's experiment, and fits that end early."
                )
            pages.append(write_report(result, folder))
            results.append(result)
            output.note(f"{name}: {result.seconds:.0f} s")
            if args.write:
                figures_table.renew(Path(args.write), f"reproduce {name}", result.figures)
    if len(results) > 1:
        pages.append(write_index(results, folder))
    return _print(results, pages)


def _measured(args: argparse.Namespace, folder: Path) -> int:
    """Evaluate what others measured. Returns the exit code: 2 where a folder could not be used, although others were."""
    from gravcomp.experiments import measured
    from gravcomp.report import figures_table
    from gravcomp.report.page import write_report

    started = time.perf_counter()
    with output.stages("measured") as show:
        result = measured.run(
            Path(args.data).expanduser() if args.data else measured.default_folder(),
            show,
            brief=args.brief,
        )
    result.seconds = time.perf_counter() - started
    if args.brief:
        result.notes.insert(0, "Run with --brief: fewer cases on coarser meshes.")
    if args.write:
        figures_table.renew(Path(args.write), "reproduce measured", result.figures)
    code = _print([result], [write_report(result, folder)])
    for failure in result.failures:
        print(f"gravcomp reproduce: {failure}", file=sys.stderr)
    return 2 if result.failures else code


def _evaluate_bag(args: argparse.Namespace, setup: "Setup", folder: Path) -> int:
    """Evaluate a recorded robot in place of the virtual robot. Returns the exit code.

    Raises ConfigError when the bag does not contain what the experiment needs; `all` leaves such experiments out with a note.
    """
    from gravcomp.config import ConfigError
    from gravcomp.evaluation.recorded import EVALUATIONS, evaluation
    from gravcomp.evaluation.recorded.run import RecordedRun
    from gravcomp.report.page import write_report

    recorded = RecordedRun(Path(args.bag).expanduser(), setup, args.tip_topic)
    # Several experiments share one evaluation; `all` runs each evaluation once.
    names = list({module: name for name, module in reversed(EVALUATIONS.items())}.values()) if args.name == "all" else [args.name]
    results, pages = [], []
    for name in names:
        started = time.perf_counter()
        result = _unless_left_out(evaluation, name, recorded, args.name == "all")
        if result is None:
            continue
        result.name, result.bag, result.seconds = name, args.bag, time.perf_counter() - started
        result.parameters["robot"] = setup.source
        pages.append(write_report(result, folder))
        results.append(result)
    if not results:
        raise ConfigError(f"{args.bag}: contains nothing that an experiment could be evaluated from")
    return _print(results, pages)


def _unless_left_out(find: "Callable[[str], Any]", name: str, subject: Any, among_all: bool) -> "Result | None":
    """Return the result of an experiment; among all, one that this robot or bag does not allow is None, with a note.

    find: returns the module of a name, whose `run` takes the subject. Raises ConfigError for one that was asked for alone.
    """
    from gravcomp.calibration.measured import MeasurementError
    from gravcomp.closed_loop.loop_failed import LoopFailed
    from gravcomp.config import ConfigError

    try:
        result: Result = find(name).run(subject)
        return result
    except (ConfigError, MeasurementError, LoopFailed) as error:
        if not among_all:
            raise ConfigError(str(error)) from error
        output.note(f"{name}: {error}")
        return None


def _print(results: "list[Result]", pages: list[Path]) -> int:
    """Print figures and pages. Returns the exit code."""
    from rich.console import Group
    from rich.markup import escape

    from gravcomp.report import figures_table

    parts: list[RenderableType] = []
    for result in results:
        parts += [figures_table.rich_table(f"{result.title}  ({result.seconds:.0f} s)", result.figures), ""]
    parts += [f"[dim]{escape(str(page))}[/dim]" for page in pages]
    reached = all(result.reached for result in results)
    output.result({"experiments": [result.to_mapping() for result in results], "reached": reached}, Group(*parts))
    return 0 if reached else 1
