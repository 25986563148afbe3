"""A clamped rod under gravity, and forces and moments in its middle and at its tip, against SoRoSim; nothing is fitted.

Forces and moments of the table are constant in the base frame, whose x is the straight rod: turning with the section they miss by
8 to 40 % of the length. A rod's clamp leaves the contraction across free; that of the finite elements holds it, which acts like a
rod that is shorter by 0.1 of its radius. Elements as long as the radius make five times as much of it: the layers at the clamp
have to be thin.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.calibration.measured import MeasurementError
from gravcomp.description import Elements, Material, Robot, Segment
from gravcomp.experiments.measured.folder_table import folder_table
from gravcomp.experiments.measured.part import Part
from gravcomp.full_model.wrench import Wrench
from gravcomp.report.result import Figure, Table
from gravcomp.simulation import Simulator

LENGTH = 0.4
_ROD = Segment("rod", LENGTH, 0.01, material=Material("svk", 70e6, 0.4, density=1200.0))
_ELEMENTS = Elements(around=8, along=24, grading=32.0, equal_stiffness=True)
_FORCES, _ANGLES = ("Px", "Py", "Pz"), ("EulX", "EulY", "EulZ")  # lines of each shape: forces and places, moments and angles
_LOADS = ("gravity", "mid_wrench", "tip_wrench")  # columns


@dataclasses.dataclass(frozen=True)
class RodShape:
    """A resting shape, with z along the straight rod: gravity (3,) in m/s^2, the wrenches, and the tip (3,) in m."""

    name: str
    gravity: np.ndarray
    wrenches: tuple[Wrench, ...]
    tip: np.ndarray


def read(folder: Path) -> tuple[list[RodShape], list[str]]:
    """Return the shapes of the table, and the names of those whose six lines are not all there. Raises MeasurementError."""
    table = folder_table(folder, "statics.csv")
    table.require(["rowLabel", *_LOADS])
    tips = [name for name in table.header if name.startswith("seg")]
    if not tips:
        raise MeasurementError(f"{table.path}: has no column of a station, such as seg2_s07; found: {', '.join(table.header)}")
    columns = (*_LOADS, max(tips))
    # The arc lengths of the stations stand in a line of their own.
    table = table.only(["_" in label for label in table.texts("rowLabel")])
    lines: dict[str, dict[str, np.ndarray]] = {}
    for label, values in zip(table.texts("rowLabel"), table.vectors(columns)):
        line, _, name = label.partition("_")
        lines.setdefault(name, {})[line] = values
    whole = {name: shape for name, shape in lines.items() if all(line in shape for line in (*_FORCES, *_ANGLES))}
    if not whole:
        raise MeasurementError(f"{table.path}: contains no shape with all of the lines {', '.join((*_ANGLES, *_FORCES))}")
    return [_shape(name, shape) for name, shape in whole.items()], [name for name in lines if name not in whole]


def _shape(name: str, lines: dict[str, np.ndarray]) -> RodShape:
    """Return a shape from its six lines, each with the columns of loads and the tip."""
    # x of the table runs along the rod.
    force, angle = (np.array([lines[row] for row in (rows[1], rows[2], rows[0])]) for rows in (_FORCES, _ANGLES))
    wrenches = tuple(
        Wrench(force[:, column], angle[:, column], station)
        for column, station in ((1, 0.5), (2, 1.0))
        if force[:, column].any() or angle[:, column].any()
    )
    return RodShape(name, force[:, 0], wrenches, force[:, -1])


def evaluate(folder: Path, progress: Callable[[str], None], brief: bool = False, count: int | None = None) -> Part:
    """Compute all shapes, or the first `count` (brief: three)."""
    shapes, incomplete = read(folder)
    shapes = shapes[: 3 if brief else count]
    simulator = Simulator(Robot("rod", segments=(_ROD,), elements=_ELEMENTS), reduced=False)
    free: list[tuple] = []
    loaded: list[tuple] = []
    for number, shape in enumerate(shapes):
        progress(f"shape {number + 1} of {len(shapes)}")
        found = simulator.solve(shape.gravity, wrench=shape.wrenches or None)
        error = float(np.linalg.norm(found.tip_position - shape.tip)) if found.is_equilibrium else np.nan
        (loaded if shape.wrenches else free).append((shape.name, 1e3 * error, 100 * error / LENGTH))
    figures, data = [], {"rod_error_pct": float(np.max([row[2] for row in free + loaded]))}
    for rows, kind, key in (
        (free, "gravity alone", "rod_gravity_error_pct"),
        (loaded, "gravity and wrenches", "rod_wrench_error_pct"),
    ):
        if rows:
            worst = float(np.max([row[2] for row in rows]))
            data[key], data[key.replace("error", "median")] = worst, float(np.nanmedian([row[2] for row in rows]))
            figures.append(Figure(f"rod, {kind}: tip error, worst, share of the length", worst, "%", "", 0.3))
            figures.append(
                Figure(f"rod, {kind}: tip error, median, share of the length", data[key.replace("error", "median")], "%")
            )
    table = Table(
        "Rod: tips", ("shape", "tip error, mm", "share of the length, %"), free + loaded,
        "Reference: SoRoSim. Nothing fitted; forces and moments constant in the base frame.",
    )  # fmt: skip
    notes = [f"rod_wrench: {len(incomplete)} shapes lack some of their six lines; left out"] if incomplete else []
    return Part(figures, [table], notes, data)
