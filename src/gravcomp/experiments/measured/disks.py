"""Backbones with disks against a Cosserat rod whose tendons run straight from disk to disk; nothing is fitted."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.calibration.measured import MeasurementError
from gravcomp.description import Cable, Disks, Elements, Material, Robot, Segment
from gravcomp.experiments.measured.folder_table import folder_table
from gravcomp.experiments.measured.part import Part
from gravcomp.full_model.wrench import Wrench
from gravcomp.report.result import Figure, Table
from gravcomp.simulation import Simulator

_MODEL = "straight_between_disks"
_COLUMNS = (
    *(f"{name}{j}{unit}" for j in (1, 2) for name, unit in (("length", "_m"), ("disks", ""), ("pitch", "_m"))),
    "youngs_modulus_pa", "backbone_radius_m", *(f"t{i}_n" for i in range(1, 7)),
    *(f"f{axis}_n" for axis in "xyz"), *(f"p{axis}_m" for axis in "xyz"),
)  # fmt: skip


def robot(case: dict[str, float]) -> Robot:
    """Return the robot of a row of the table, its cells by column."""
    material = Material(youngs_modulus=case["youngs_modulus_pa"], poissons_ratio=0.3, density=0.0)
    segments, cables = [], []
    for j in (1, 2):
        pitch, length = case[f"pitch{j}_m"], case[f"length{j}_m"]
        disks = Disks(int(case[f"disks{j}"]), 2.5 * pitch)
        segments.append(Segment(f"s{j}", length, 2 * case["backbone_radius_m"], material=material, disks=disks))
        cables += [Cable(f"c{j}{k}", np.radians(angle), pitch, segment=f"s{j}") for k, angle in enumerate((90.0, -30.0, 210.0))]
    elements = Elements(around=4, along=40, grading=1.0, equal_stiffness=True)
    return Robot("disks", segments=tuple(segments), cables=tuple(cables), elements=elements)


def evaluate(folder: Path, progress: Callable[[str], None], brief: bool) -> Part:
    """Compute the tips of all cases (brief: of three)."""
    table = folder_table(folder, "tips.csv")
    table.require(["case", "model", *_COLUMNS])
    table = table.only([name == _MODEL for name in table.texts("model")])
    if not table.rows:
        raise MeasurementError(f"{table.path}: contains no rows of the model '{_MODEL}'")
    values = table.vectors(_COLUMNS)[: 3 if brief else None]
    rows = []
    for number, (name, row) in enumerate(zip(table.texts("case"), values)):
        progress(f"case {number + 1} of {len(values)}")
        case = dict(zip(_COLUMNS, row.tolist()))
        one = robot(case)
        tension = np.array([case[f"t{i}_n"] for i in range(1, 7)])
        wrench = Wrench(force=np.array([case[f"f{axis}_n"] for axis in "xyz"]))
        shape = Simulator(one, reduced=False).solve(np.zeros(3), tension=tension, wrench=wrench)
        expected = np.array([case[f"p{axis}_m"] for axis in "xyz"])
        error = float(np.linalg.norm(shape.tip_position - expected)) if shape.is_equilibrium else np.nan
        rows.append((name, 1e3 * one.length, 1e3 * float(np.linalg.norm(expected)), 1e3 * error, 100 * error / one.length))
    worst = float(np.max([row[4] for row in rows]))
    header = ("case", "length, mm", "tip from the base, mm", "tip error, mm", "share of the length, %")
    return Part(
        figures=[Figure("disks: tip error, worst, share of the length", worst, "%", "", 0.3)],
        parts=[
            Table(
                "Backbones with disks",
                header,
                rows,
                "Reference: the authors' Cosserat rod with straight tendons. Nothing fitted.",
            )
        ],
        data={"disks_error_pct": worst},
    )
