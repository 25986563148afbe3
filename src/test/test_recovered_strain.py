"""The error of a mesh that is estimated from one shape, against a finer mesh, and what `model info` says of a file."""

import dataclasses

import numpy as np
import pytest
from mesh_bodies import TAPERED_TUBE

from gravcomp.commands.model.info import _file_error
from gravcomp.description import Elements, Robot, Segment, load_robot_file
from gravcomp.full_model.mesh_loads import _turned, mesh_loads, shapes_under
from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.recovered_strain import estimated_error


def test_the_estimate_is_about_the_distance_from_a_finer_mesh():
    cables = load_robot_file("mesh_body").robot.cables
    tube = Segment("a", 0.08, 9e-3, 3e-3, tip_outer_diameter=6e-3)
    coarse, fine = (
        MeshedModel(Robot("tube", segments=(tube,), cables=cables, elements=Elements(around=a, along=n, grading=1.0)))
        for a, n in ((6, 9), (8, 20))
    )
    loads = mesh_loads(coarse)
    here = shapes_under(coarse, loads)
    assert _turned(coarse, here.shapes[-1]) == pytest.approx(np.pi / 2, abs=0.06)  # the bend ends there, not up to a third beyond
    distance = np.linalg.norm(here.tips - shapes_under(fine, loads, near=here).tips, axis=1).max() / coarse.length
    estimate = estimated_error(coarse)
    assert 0.4 * distance < estimate.error < 2.0 * distance
    assert estimate.element_length == pytest.approx(0.08 / 9, rel=1e-6) and 0.0 < estimate.place < 0.08


@pytest.mark.slow
def test_info_says_whether_the_mesh_of_a_file_is_fine_enough_and_what_would_be():
    shipped = load_robot_file("mesh_body").robot
    good = _file_error(MeshedModel(shipped))
    assert good["estimated_error_pct"] < 0.1 and good["refinement"] == "fine enough"
    coarse = dataclasses.replace(shipped, body=dataclasses.replace(shipped.body, file=str(TAPERED_TUBE)))
    poor = _file_error(MeshedModel(coarse))
    assert poor["estimated_error_pct"] > 0.4 and poor["worst_load"] == "bent"
    assert poor["refinement"].startswith("too coarse; use elements of ")
