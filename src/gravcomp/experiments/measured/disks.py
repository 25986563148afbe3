"""Backbones with disks against a Cosserat rod whose tendons run straight from disk to disk; nothing is fitted."""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.calibration.measured import MeasurementError
from gravcomp.description import Cable, Disks, Elements, Material, Robot, Segment
from gravcomp.experiments.measured.part import Part
from gravcomp.full_model.wrench import Wrench
from gravcomp.report.result import Figure, Table
from gravcomp.simulation import Simulator

_MODEL = "straight_between_disks"


def robot(case: dict[str, str]) -> Robot:
    """Return the robot of a row of the table."""
    material = Material(youngs_modulus=float(case["youngs_modulus_pa"]), poissons_ratio=0.3, density=0.0)
    segments, cables = [], []
    for j in (1, 2):
        pitch, length = float(case[f"pitch{j}_m"]), float(case[f"length{j}_m"])
        disks = Disks(int(case[f"disks{j}"]), 2.5 * pitch)
        segments.append(Segment(f"s{j}", length, 2 * float(case["backbone_radius_m"]), material=material, disks=disks))
        cables += [Cable(f"c{j}{k}", np.radians(angle), pitch, segment=f"s{j}") for k, angle in enumerate((90.0, -30.0, 210.0))]
    elements = Elements(around=4, along=40, grading=1.0, equal_stiffness=True)
    return Robot("disks", segments=tuple(segments), cables=tuple(cables), elements=elements)


def evaluate(folder: Path, progress: Callable[[str], None], brief: bool) -> Part:
    """Compute the tips of all cases (brief: of three)."""
    try:
        with (folder / "tips.csv").open(newline="", encoding="utf-8") as file:
            cases = [case for case in csv.DictReader(file) if case["model"] == _MODEL]
    except (OSError, KeyError) as reason:
        raise MeasurementError(f"{folder / 'tips.csv'}: cannot be read: {reason}") from reason
    if not cases:
        raise MeasurementError(f"{folder / 'tips.csv'}: contains no rows of the model '{_MODEL}'")
    rows = []
    for number, case in enumerate(cases[:3] if brief else cases):
        progress(f"case {number + 1} of {len(cases)}")
        one = robot(case)
        tension = np.array([float(case[f"t{i}_n"]) for i in range(1, 7)])
        wrench = Wrench(force=np.array([float(case[f"f{axis}_n"]) for axis in "xyz"]))
        shape = Simulator(one, reduced=False).solve(np.zeros(3), tension=tension, wrench=wrench)
        expected = np.array([float(case[f"p{axis}_m"]) for axis in "xyz"])
        error = float(np.linalg.norm(shape.tip_position - expected)) if shape.is_equilibrium else np.nan
        rows.append(
            (case["case"], 1e3 * one.length, 1e3 * float(np.linalg.norm(expected)), 1e3 * error, 100 * error / one.length)
        )
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
