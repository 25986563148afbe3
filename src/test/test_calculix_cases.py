"""The full model is held against CalculiX on tapered and eccentric bodies, with two laws, and near incompressibility."""

import dataclasses

import numpy as np
import pytest

from gravcomp.description import Material
from gravcomp.mesh import tube_mesh
from gravcomp.references import calculix
from gravcomp.references.calculix_cases import robot_of, stored_cases
from gravcomp.simulation import Simulator


@pytest.mark.parametrize(
    "case", [c for c in stored_cases() if c.inclination != 0.0 or c.law == "neo_hookean"], ids=lambda c: f"{c.name}, {c.law}"
)
def test_tips_agree_within_a_fifth_of_a_percent(case):
    shape = Simulator(case.robot, reduced=False).solve(case.gravity)
    error = np.linalg.norm(shape.tip_position - [0.0, 0.0, case.robot.length] - case.tip)
    assert shape.is_equilibrium and error < 2e-3 * case.robot.length


def test_the_deck_of_a_hyperelastic_body_has_its_constants_and_other_laws_are_refused():
    robot = robot_of("taper", "neo_hookean")
    lines = calculix.deck(tube_mesh(robot, along=4), 0.0).splitlines()
    c10, d1 = (float(x) for x in lines[lines.index("*HYPERELASTIC, NEO HOOKE") + 1].split(","))
    young, nu = 0.7e6, 0.45
    assert c10 == pytest.approx(young / (2 * (1 + nu)) / 2)  # mu / 2
    assert d1 == pytest.approx(2 / (young / (3 * (1 - 2 * nu))))  # 2 / kappa
    yeoh = dataclasses.replace(robot, segments=(dataclasses.replace(robot.segments[0], material=Material("yeoh")),))
    with pytest.raises(ValueError, match="'yeoh' is not compared"):
        calculix.deck(tube_mesh(yeoh, along=4), 0.0)
