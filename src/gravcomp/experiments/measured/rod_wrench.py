"""A clamped rod under gravity, and forces and moments in its middle and at its tip, against SoRoSim; nothing is fitted.

Forces and moments of the table are constant in the base frame, whose x is the straight rod: turning with the section they miss by
8 to 40 % of the length. A rod's clamp leaves the contraction across free; that of the finite elements holds it, which acts like a
rod that is shorter by 0.1 of its radius. Elements as long as the radius make five times as much of it: the layers at the clamp
have to be thin.
"""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.calibration.measured import MeasurementError
from gravcomp.description import Elements, Material, Robot, Segment
from gravcomp.experiments.measured.part import Part
from gravcomp.full_model.wrench import Wrench
from gravcomp.report.result import Figure, Table
from gravcomp.simulation import Simulator

LENGTH = 0.4
_ROD = Segment("rod", LENGTH, 0.01, material=Material("svk", 70e6, 0.4, density=1200.0))
_ELEMENTS = Elements(around=8, along=24, grading=32.0, equal_stiffness=True)
_FORCES, _ANGLES = ("Px", "Py", "Pz"), ("EulX", "EulY", "EulZ")


def read(path: Path) -> dict[str, dict[str, np.ndarray]]:
    """Return, for each shape, the columns of its six lines. Raises MeasurementError."""
    shapes: dict[str, dict[str, np.ndarray]] = {}
    try:
        with path.open(newline="", encoding="utf-8") as file:
            for row in list(csv.reader(file))[2:]:
                line, _, name = row[0].partition("_")
                shapes.setdefault(name, {})[line] = np.array([float(value) for value in row[1:]])
    except (OSError, ValueError, IndexError) as error:
        raise MeasurementError(f"{path}: cannot be read: {error}") from error
    for name, shape in shapes.items():
        missing = [line for line in (*_FORCES, *_ANGLES) if line not in shape]
        if missing:
            raise MeasurementError(f"{path}: the shape {name} has no line {missing[0]}_{name}")
    return shapes


def in_soft_base(shape: dict[str, np.ndarray], lines: tuple[str, ...], column: int) -> np.ndarray:
    """Return the vector (3,) in a column, with z along the rod."""
    x, y, z = (float(shape[line][column]) for line in lines)
    return np.array([y, z, x])


def evaluate(folder: Path, progress: Callable[[str], None], brief: bool = False, count: int | None = None) -> Part:
    """Compute all shapes, or the first `count` (brief: three)."""
    shapes = read(folder / "statics.csv")
    simulator = Simulator(Robot("rod", segments=(_ROD,), elements=_ELEMENTS), reduced=False)
    free: list[tuple] = []
    loaded: list[tuple] = []
    for number, (name, shape) in enumerate(shapes.items()):
        if number == (3 if brief else count):
            break
        progress(f"shape {number + 1} of {len(shapes)}")
        wrenches = []
        for column, station in ((1, 0.5), (2, 1.0)):
            force, moment = in_soft_base(shape, _FORCES, column), in_soft_base(shape, _ANGLES, column)
            if force.any() or moment.any():
                wrenches.append(Wrench(force, moment, station))
        found = simulator.solve(in_soft_base(shape, _FORCES, 0), wrench=tuple(wrenches) or None)
        error = float(np.linalg.norm(found.tip_position - in_soft_base(shape, _FORCES, -1))) if found.is_equilibrium else np.nan
        (loaded if wrenches else free).append((name, 1e3 * error, 100 * error / LENGTH))
    figures, data = [], {}
    for rows, kind, key in ((free, "gravity alone", "rod_error_pct"), (loaded, "gravity and wrenches", "rod_wrench_error_pct")):
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
    return Part(figures, [table], data=data)
