"""Runs, figures, tables and drawings of a person who steers through a lumen; shared by the two experiments in lumens."""

import dataclasses

import numpy as np

from gravcomp.closed_loop.setup import Setup
from gravcomp.report.drawing import REAL, TARGET, Drawing, draw_robot
from gravcomp.report.drawing import WITHOUT as WITHOUT_COLOUR
from gravcomp.report.result import Figure, Plot, Result, Table
from gravcomp.trials.calibration_run import calibrate_on_virtual_robot
from gravcomp.trials.context import Context
from gravcomp.trials.lumen import Reach
from gravcomp.trials.steered import DEPTH, Passage, Steered, steer

_SEEDS = 20
_SECONDS, _BRIEF_SECONDS = 20.0, 1.0  # until a run is given up
_FIRST, _DEPTHS = 0.35, (0.85, 1.0)  # of the robot's length: the tip at the start, the target
_NEEDED = 0.95  # share of the seeds that compensation is to bring to the target
_FORCE_RATIO = 3.0
_LIGHTER = 20.0  # times: a robot whose sag presses on no wall, but whose inertia still lets it be simulated


def add_steering(result: Result, context: Context, reaches: tuple[Reach, ...]) -> None:
    """Add to `result` what a person reaches in the lumens of `reaches`, with the calibrated controller; seeds take turns."""
    setup = context.once(calibrate_on_virtual_robot).setup
    seeds = range(1, 2 if context.brief else 1 + _SEEDS)
    seconds = _BRIEF_SECONDS if context.brief else _SECONDS
    passages = [_passage(setup, reaches[seed % len(reaches)], seed, seconds) for seed in seeds]
    jobs = [(setup, passage, way, seed) for passage, seed in zip(passages, seeds) for way in (True, False)]
    runs = context.map(steer, jobs, "a person steers through lumens")
    held, without = runs[::2], runs[1::2]
    ratio = _peak_ratio(without, held)
    n = len(held)
    light: list[Steered] = []
    if not context.brief:  # a brief run is given up before a person can reach the target
        result.figures += [
            Figure(f"steered: reached with compensation, of {n}", sum(r.reached for r in held), "", limit=np.ceil(_NEEDED * n),
                   at_least=True),
            Figure(f"steered: reached without compensation, of {n}", sum(r.reached for r in without), ""),
        ]  # fmt: skip
        # What the person presses even if gravity does nothing: no compensation can make the peak less than that.
        jobs = [(nearly_weightless(setup), passage, False, seed) for passage, seed in zip(passages, seeds)]
        light = context.map(steer, jobs, "a person steers a robot of hardly any weight")
        least = float(np.median([r.peak for r in light]))
        result.figures += [
            Figure("steered: peak force of the wall, without compensation / robot of hardly any weight, median of the seeds",
                   _peak_ratio(without, light), ""),
            Figure("steered: peak force of the wall, robot of hardly any weight, median", least, "N"),
        ]  # fmt: skip
    result.figures += [
        Figure("steered: peak force of the wall, without / with compensation, median of the seeds", ratio, "", limit=_FORCE_RATIO,
               at_least=True),
        Figure("steered: peak force of the wall with compensation, median", float(np.median([r.peak for r in held])), "N"),
        Figure("steered: deepest place in a wall, all runs", 1e3 * max(r.worst for r in runs), "mm", limit=1e3 * DEPTH),
    ]  # fmt: skip
    header = ("seed", "lumen", "compensation", "reached", "time, s", "peak force, N", "mean force, N", "path of the tip, mm",
              "time at pain, %", "deepest in the wall, mm")  # fmt: skip
    ways = [(r, "with" if r.compensated else "without") for r in runs] + [(r, "hardly any weight") for r in light]
    rows = [
        (r.seed, r.passage.name, way, "yes" if r.reached else "no", r.time, r.peak, r.mean, 1e3 * r.path, 1e2 * r.hurt,
         1e3 * r.worst)
        for r, way in ways
    ]  # fmt: skip
    result.parts += [
        Plot(
            "A person steers: the lumen and the path of the tip",
            _lumens(held[: len(reaches)], without[: len(reaches)]),
            "Section in the plane of bending. Vermilion with compensation, pink without; dot: the target on the wall.",
        ),
        Plot("A person steers: force of the wall", _forces(held, without), "Sum of the sizes of all contact forces; every seed."),
        Table(
            "A person steers to a target on the wall",
            header,
            rows,
            "Reached: the target near the middle of the picture, and in reach of a tool, for half a second, no wall entered by"
            f" more than {1e3 * DEPTH:g} mm. A run that does not reach it within {seconds:g} s is given up.",
        ),
    ]
    result.notes += [
        "A person steers: a model of a human operator (crossover model, delay 0.25 s, remnant, tremor; src/gravcomp/operator)"
        " sees the picture of a camera at the tip, bends the tip, pushes the handle, and pulls back at pain. The wall is rigid,"
        " with friction. The machine lets the body follow the path of the tip; the controller's model does not know the wall.",
    ]


def nearly_weightless(setup: Setup) -> Setup:
    """Return a setup whose virtual robot has a twentieth of its density: as if gravity were compensated perfectly."""
    body = setup.truth.body
    density = body.density or setup.nominal.materials[0].density
    light = dataclasses.replace(body, density=density / _LIGHTER)
    return dataclasses.replace(setup, truth=dataclasses.replace(setup.truth, body=light))


def _peak_ratio(runs: list[Steered], others: list[Steered]) -> float:
    """Return the median of the ratios of the peak forces of runs to those of others, with the same seeds."""
    return float(np.median([one.peak / max(other.peak, 1e-6) for one, other in zip(runs, others)]))


def _passage(setup: Setup, reach: Reach, seed: int, seconds: float) -> Passage:
    length, random = setup.robot.length, np.random.default_rng([seed, 11])
    return Passage(
        reach.name, reach.lumen, reach.inclination, reach.roll, first=_FIRST * length,
        depth=random.uniform(*_DEPTHS) * length, angle=random.uniform(0.0, 2.0 * np.pi), seconds=seconds,
    )  # fmt: skip


def _lumens(held: list[Steered], without: list[Steered]) -> str:
    with Drawing(1, len(held), width=9.0, height=4.4, squeeze=False) as drawing:
        for axes, one, other in zip(drawing.axes[0], held, without):
            lumen = one.passage.lumen
            sideways = np.array([np.cos(lumen.plane), np.sin(lumen.plane), 0.0])
            way = np.linspace(0.0, one.passage.depth + 5e-3, 200)
            centre = lumen.point(way)
            normal = np.cross(np.array([-sideways[1], sideways[0], 0.0]), lumen.direction(way))
            for sign in (-1, 1):
                side = centre + sign * normal * lumen.diameter / 2
                axes.plot(1e3 * side @ sideways, 1e3 * side[:, 2], color="#8a6d5a", linewidth=2.0)
            for run, colour in ((other, WITHOUT_COLOUR), (one, REAL)):
                axes.plot(1e3 * run.tip @ sideways, 1e3 * run.tip[:, 2], color=colour, linewidth=1.0)
                body = run.body[-1]
                draw_robot(axes, np.stack([body @ sideways, body[:, 2]], axis=1), colour)
            target = one.passage.target()
            axes.plot([1e3 * target @ sideways], [1e3 * target[2]], "o", color=TARGET)
            axes.set_aspect("equal")
            axes.set_title(one.passage.name)
            axes.set_xlabel("in the plane of bending, mm")
            axes.set_ylabel("along the inlet, mm")
    return drawing.svg


def _forces(held: list[Steered], without: list[Steered]) -> str:
    with Drawing(1, 2, width=9.0, height=3.0, sharey=True) as drawing:
        for axes, runs, colour, title in zip(drawing.axes, (without, held), (WITHOUT_COLOUR, REAL), ("without", "with")):
            for run in runs:
                axes.plot(run.samples, run.force, color=colour, linewidth=0.7, alpha=0.6)
            axes.set_title(f"{title} compensation")
            axes.set_xlabel("time in s")
        drawing.axes[0].set_ylabel("force of the wall in N")
    return drawing.svg
