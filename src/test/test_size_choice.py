"""The choice of the size of tetrahedra where a shape needs many of them: without meshes that cannot be used."""

import math

import pytest
from mesh_bodies import surface

from gravcomp.description import MeshBody, Robot
from gravcomp.full_model import size_choice
from gravcomp.full_model.recovered_strain import MeshEstimate

trimesh = pytest.importorskip("trimesh")


@pytest.fixture
def robot(monkeypatch, tmp_path):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    trimesh.Trimesh(*surface(), process=False).export(tmp_path / "body.stl")
    monkeypatch.setattr(size_choice, "first_size", lambda body: 1e-3)
    return Robot("body", body=MeshBody(str(tmp_path / "body.stl")))


def meshed(monkeypatch, cost, estimated) -> list[float]:
    """Let a size be its own model, a step of which takes `cost` times as long as it may; return the list of those made."""
    made: list[float] = []
    monkeypatch.setattr(size_choice, "MeshedModel", lambda robot: made.append(robot.body.element_size) or made[-1])
    monkeypatch.setattr(size_choice, "too_long", cost)
    monkeypatch.setattr(size_choice, "estimated_error", lambda size: MeshEstimate(estimated(size), "bent", 0.0, size))
    return made


def test_larger_elements_that_change_nothing_are_not_tried_again_and_the_error_is_estimated(robot, monkeypatch):
    made = meshed(monkeypatch, lambda size: 1.5 if size > 1.2e-3 else 3.0, lambda size: 0.02)
    chosen = size_choice.with_chosen_size(robot).body.element_size
    assert len(made) == 4 and made[0] == 1e-3 < made[1] < made[2] and chosen == made[1] == made[3]
    assert math.isclose(size_choice.with_chosen_size(robot).body.element_size, chosen) and len(made) == 4
    assert size_choice.chosen_estimate(robot) == MeshEstimate(0.02, "bent", 0.0, chosen)


def test_elements_that_are_known_to_take_too_long_are_not_made_again(robot, monkeypatch, caplog):
    made = meshed(monkeypatch, lambda size: (1.1e-3 / size) ** 7, lambda size: 0.02)
    size_choice.with_chosen_size(robot)
    assert made == [1e-3, pytest.approx(1.155e-3)]  # an error of 2 % asks for 0.46 mm
    assert "leave an estimated error of 2 %" in caplog.text
