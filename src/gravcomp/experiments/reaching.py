"""Runs, figures, tables and drawings that the two experiments in lumens share."""

import dataclasses
from typing import Any

import numpy as np

from gravcomp.report.drawing import REAL, TARGET, Drawing, draw_robot
from gravcomp.report.drawing import WITHOUT as WITHOUT_COLOUR
from gravcomp.report.result import Figure, Plot, Result, Table
from gravcomp.trials.calibration_run import calibrate_on_virtual_robot
from gravcomp.trials.context import Context
from gravcomp.trials.holding import GROUND
from gravcomp.trials.lumen import FED, HELD, WITHOUT, Reach, Reached, run_reach

_WAYS = (WITHOUT, HELD, FED)
_Triple = tuple[Reached, Reached, Reached]  # of a reach, in these ways
_BRIEF_REST, _BRIEF_DURATION = 1.0, 1.0  # s, of a reach


def reaching(context: Context, name: str, title: str, question: str, reaches: tuple[Reach, ...]) -> Result:
    """Run every reach with the calibrated controller: without compensation, with it, and with it and a base that is fed."""
    setup = context.once(calibrate_on_virtual_robot).setup
    if context.brief:
        reaches = (dataclasses.replace(reaches[-1], rest=_BRIEF_REST, duration=_BRIEF_DURATION),)
    results = context.map(run_reach, [(setup, reach, way) for reach in reaches for way in _WAYS], "reaching through lumens")
    triples = list(zip(results[::3], results[1::3], results[2::3]))
    pairs = [triple[:2] for triple in triples]
    return Result(
        name=name,
        title=title,
        question=question,
        ground=GROUND,
        figures=_figures(triples),
        parts=[
            Plot(
                "Bodies in the lumen",
                _bodies(pairs),
                "Section of the lumen in its plane of bending (first of each pair) and across it; vermilion with compensation,"
                " pink without; at three times.",
            ),
            Plot(
                "Over the depth",
                _courses(pairs),
                "Smallest clearance to the wall and camera axis error over the depth of the tip.",
            ),
            _table(triples),
        ],
        parameters={reach.name: _parameters(reach) for reach in reaches},
        notes=[
            "Cables only pull: bending the robot also shortens it, by some millimetres at the end of a bend, with compensation"
            " and without. No cable can compensate this; advancing the base can, by the shortening that the model predicts"
            " (base fed). The shortening is part of the tip error, not of the lateral error.",
            "Bodies in the lumen, clearance and tip errors: the base moves as given, and there is no wall, so that only the"
            " compensation forms the robot. A negative clearance is the depth by which the robot would enter a wall; none of"
            " these runs counts as reached. The runs in which a person steers have the wall.",
            "Without compensation: the cables that bend the weightless robot along the lumen are pulled in, the others are"
            " released.",
        ],
    )


def _figures(triples: list[_Triple]) -> list[Figure]:
    figures = []
    for without, held, fed in triples:
        gain = float(without.tip_error.mean() / held.tip_error.mean())
        figures += [
            Figure(f"{held.reach.name}: tip error ratio, without / with compensation", gain, "", limit=5.0, at_least=True),
            Figure(
                f"{held.reach.name}: tip error ratio, base fed by the predicted shortening",
                float(without.tip_error.mean() / fed.tip_error.mean()),
                "",
                limit=5.0,
                at_least=True,
            ),
            Figure(
                f"{held.reach.name}: lateral tip error ratio, without / with compensation",
                float(without.lateral.mean() / held.lateral.mean()),
                "",
            ),
            Figure(f"{held.reach.name}: smallest clearance to the wall", 1e3 * float(held.clearance.min()), "mm"),
            Figure(
                f"{held.reach.name}: smallest clearance to the wall, without compensation",
                1e3 * float(without.clearance.min()),
                "mm",
            ),
            Figure(f"{held.reach.name}: camera axis error, mean", float(np.degrees(held.camera.mean())), "deg"),
        ]
    return figures


def _table(triples: list[_Triple]) -> Table:
    rows = [
        (
            r.reach.name,
            kind,
            1e3 * r.clearance.min(),
            1e3 * r.clearance[np.isfinite(r.clearance)].mean(),
            1e3 * r.deviation.mean(),
            1e3 * r.tip_error.mean(),
            1e3 * r.lateral.mean(),
            float(np.degrees(r.camera.mean())),
            float(np.degrees(r.camera.max())),
        )
        for triple in triples
        for kind, r in zip(_WAYS, triple)
    ]
    return Table(
        "With and without compensation",
        (
            "lumen",
            "compensation",
            "smallest clearance, mm",
            "mean clearance, mm",
            "tip from centreline, mm",
            "tip error, mm",
            "lateral, mm",
            "camera error, deg",
            "largest, deg",
        ),
        rows,
        "Tip error: distance to the target in soft_base; lateral: its part across the target direction, without the"
        " shortening. Base fed: the base is advanced by the shortening that the model predicts. Tip from centreline"
        " and clearance: in the lumen's frame, so they include the tremor of the base, which no cable can compensate.",
    )


def _parameters(reach: Reach) -> dict[str, Any]:
    return {
        "inlet_mm": 1e3 * reach.lumen.inlet,
        "radius_mm": 1e3 * reach.lumen.radius,
        "plane_deg": float(np.degrees(reach.lumen.plane)),
        "diameter_mm": 1e3 * reach.lumen.diameter,
        "inclination_deg": reach.inclination,
        "roll_deg": reach.roll,
        "tip from mm": 1e3 * reach.first,
        "to mm": 1e3 * reach.last,
        "duration_s": reach.duration,
        "trembling hand": reach.hand,
    }


def _bodies(pairs: list[tuple[Reached, Reached]]) -> str:
    with Drawing(1, 2 * len(pairs), width=11.0, height=4.4, squeeze=False) as drawing:
        for index, (without, held) in enumerate(pairs):
            lumen = held.reach.lumen
            plane = np.array([np.cos(lumen.plane), np.sin(lumen.plane), 0.0])
            across = np.array([-plane[1], plane[0], 0.0])
            way = np.linspace(0.0, held.reach.last + 5e-3, 200)
            centre = lumen.point(way)
            normal = np.cross(across, lumen.direction(way))
            for axes, sideways, wall in zip(
                drawing.axes[0, 2 * index : 2 * index + 2], (plane, across), (normal, np.tile(across, (200, 1)))
            ):
                for sign in (-1, 1):
                    side = centre + sign * wall * lumen.diameter / 2
                    axes.plot(1e3 * side @ sideways, 1e3 * side[:, 2], color="#8a6d5a", linewidth=2.0)
                axes.plot(1e3 * centre @ sideways, 1e3 * centre[:, 2], color=TARGET, linewidth=1.0, linestyle="--")
                for moment in (0.35, 0.7, 0.999):
                    k = int(np.searchsorted(held.depth, held.reach.first + moment * (held.reach.last - held.reach.first)))
                    k = min(k, len(held.time) - 1)
                    for result, colour in ((without, WITHOUT_COLOUR), (held, REAL)):
                        body = result.body[k]
                        draw_robot(axes, np.stack([body @ sideways, body[:, 2]], axis=1), colour, alpha=0.35 + 0.65 * moment)
                axes.set_aspect("equal")
                axes.set_xlabel("in the plane of bending, mm" if sideways is plane else "across the plane of bending, mm")
                axes.set_ylabel("along the inlet, mm")
                axes.set_ylim(bottom=-30.0)
            drawing.axes[0, 2 * index].set_title(held.reach.name)
    return drawing.svg


def _courses(pairs: list[tuple[Reached, Reached]]) -> str:
    with Drawing(2, len(pairs), width=10.5, height=5.2, squeeze=False) as drawing:
        for index, pair in enumerate(pairs):
            clearance, camera = drawing.axes[:, index]
            for result, colour, label in zip(pair, (WITHOUT_COLOUR, REAL), ("without", "with compensation")):
                clearance.plot(
                    1e3 * result.depth,
                    1e3 * np.where(np.isfinite(result.clearance), result.clearance, np.nan),
                    color=colour,
                    label=label,
                )
                camera.plot(1e3 * result.depth, np.degrees(result.camera), color=colour)
            clearance.axhline(0.0, color="#8a6d5a", linewidth=2.0)
            clearance.set_title(pair[0].reach.name)
            clearance.set_ylabel("clearance in mm")
            camera.set_ylabel("camera error in deg")
            camera.set_xlabel("depth of the tip in mm")
        drawing.axes[0, 0].legend()
    return drawing.svg
