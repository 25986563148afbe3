"""The full model is held against CalculiX 2.20: 20-node reduced-integration hexahedra, large displacements."""

import csv
import dataclasses
from pathlib import Path

import numpy as np
import pytest

import gravcomp
from gravcomp.description import load_robot_file
from gravcomp.simulation import Simulator

ROWS = list(csv.DictReader((Path(gravcomp.__file__).parent / "references" / "calculix_h20r.csv").open(encoding="utf-8")))


def reference_robot(law: str, youngs_modulus: float, poissons_ratio: float):
    """The tube of the table: that of the article, but with a lumen of 3 mm and 1150 kg/m^3, and no cables."""
    robot = load_robot_file("article").robot
    segments = tuple(dataclasses.replace(s, lumen_diameter=3e-3) for s in robot.segments)
    robot = dataclasses.replace(robot, segments=segments, cables=())
    return robot.with_material(law=law, youngs_modulus=youngs_modulus, poissons_ratio=poissons_ratio, density=1150.0)


@pytest.mark.parametrize("row", ROWS, ids=lambda r: f"{r['material']}-E{r['E_MPa']}-nu{r['nu']}-{r['incl_deg']}deg")
def test_tip_and_middle_agree_with_calculix(row):
    law = {"svk": "svk", "nh": "neo_hookean"}[row["material"]]
    simulator = Simulator(reference_robot(law, float(row["E_MPa"]) * 1e6, float(row["nu"])), reduced=False)
    inclination = np.deg2rad(float(row["incl_deg"]))
    shape = simulator.solve(9.81 * np.array([-np.cos(inclination), 0.0, -np.sin(inclination)]))
    tip = np.array([float(row[f"tip_u{axis}_mm"]) for axis in "xyz"])
    middle = np.array([float(row["mid_ux_mm"]), 0.0, float(row["mid_uz_mm"])])
    # CalculiX's own discretisation error is about 0.05 mm.
    assert (shape.tip_position - [0, 0, 0.1]) * 1e3 == pytest.approx(tip, abs=0.06)
    assert (shape.backbone_position[5] - [0, 0, 0.05]) * 1e3 == pytest.approx(middle, abs=0.06)
