"""The error of a mesh that is estimated from one shape, against a finer mesh, and what `model info` says of a file."""

import dataclasses

import numpy as np
import pytest
from mesh_bodies import TAPERED_TUBE

from gravcomp.commands.model.info import _file_error
from gravcomp.description import Cable, Elements, Robot, Segment, load_robot_file
from gravcomp.full_model import recovered_strain
from gravcomp.full_model.mesh_loads import _turned, mesh_loads, shapes_under
from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.recovered_strain import can_be_estimated, estimated_error, too_long


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


def test_where_cables_make_a_step_too_long_the_error_is_estimated_without_them(monkeypatch):
    shipped = load_robot_file("mesh_body").robot
    body = dataclasses.replace(shipped.body, file=str(TAPERED_TUBE))
    # Straight from the clamp to the tip: its pieces tie distant sections together.
    cable = Cable("c", via_points=((3e-3, 0.0, 0.01), (2.5e-3, 0.0, 0.07)))
    model = MeshedModel(dataclasses.replace(shipped, body=body, cables=(cable,)))
    without = MeshedModel(dataclasses.replace(model.robot, cables=()))
    assert too_long(without) < 0.7 * too_long(model)
    monkeypatch.setattr(recovered_strain, "_LONGEST", 0.8 * too_long(model))
    estimate, alone = estimated_error(model), estimated_error(without)
    assert estimate.released and not alone.released and estimate.error == pytest.approx(alone.error, rel=1e-6)
    assert "with the cables released only" in _file_error(model, estimate)["refinement"]
    monkeypatch.setattr(recovered_strain, "_LONGEST", 0.8 * too_long(without))
    assert estimated_error(model) is None and not can_be_estimated(model)


@pytest.mark.slow
def test_info_says_whether_the_mesh_of_a_file_is_fine_enough_and_what_would_be():
    shipped = load_robot_file("mesh_body").robot
    good = _file_error(MeshedModel(shipped))
    assert good["estimated_error_pct"] < 0.1 and good["refinement"] == "fine enough"
    coarse = dataclasses.replace(shipped, body=dataclasses.replace(shipped.body, file=str(TAPERED_TUBE)))
    poor = _file_error(MeshedModel(coarse))
    assert poor["estimated_error_pct"] > 0.4 and poor["worst_load"] == "bent"
    assert poor["refinement"].startswith("too coarse; use elements of ")
