"""Symmetries of a robot's model: what is computed for one direction of gravity trains the reduced model for all its images."""

import dataclasses

import numpy as np
import pytest

from gravcomp.description import Cable, Elements, Limits, Material, Payload, PointLoad, Robot, Section, Segment
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.symmetry import symmetries
from gravcomp.simulation import Simulator
from gravcomp.training import TrainingOptions
from gravcomp.training import samples as module
from gravcomp.training.images import with_images
from gravcomp.training.samples import Sample, samples

_GRAVITY = np.array([3.0, -5.0, 2.0])


def tube(around=6, angles_deg=(0, 120, 240), modulus=2e5, **described) -> Robot:
    """A soft tube with cables along its whole length, in a coarse mesh."""
    material = Material(youngs_modulus=modulus, poissons_ratio=0.45, density=1070.0)
    segment = Segment("s", length=0.1, outer_diameter=0.02, lumen_diameter=0.01, material=material)
    cables = tuple(Cable(f"c{k}", angle=np.radians(a), radius=0.0075, segment="s") for k, a in enumerate(angles_deg))
    elements = Elements(around=around, along=4)
    return dataclasses.replace(
        Robot("tube", segments=(segment,), cables=cables, elements=elements, limits=Limits(tension_max=5.0)), **described
    )


# A moment acts on a section by two of its directions: its image does so by others.
@pytest.mark.parametrize(("moment", "apart"), [(0.0, 1e-7), (1.0, 5e-5)])
def test_the_image_of_an_equilibrium_is_one(moment, apart):
    model = RobotModel(tube())
    found = symmetries(model)
    assert len(found) == 5
    simulator = Simulator(model, reduced=False)
    tension = np.array([0.3, 0.1, 0.0])
    load = np.array([0.01, 0.02, -0.01, 1e-3 * moment, -2e-4 * moment, 5e-4 * moment, 0.5])

    def shape(gravity: np.ndarray, tension: np.ndarray, load: np.ndarray) -> np.ndarray:
        assert simulator.solve(gravity, tension=tension, wrench=module.wrench_of(load)).is_equilibrium
        return model.free(simulator.displacements).copy()

    sample = Sample(shape(_GRAVITY, tension, load), _GRAVITY, tension, np.sign(tension), load)
    first, *images = with_images([sample], found)
    assert first is sample and len(images) == 5
    assert len({tuple(image.tension) for image in images}) == 5  # each another one
    for image in images:
        again = shape(image.gravity, image.tension, image.load)
        assert np.abs(again - image.unknowns).max() < apart * model.length
        np.testing.assert_array_equal(np.sign(image.tension), image.pulling)


@pytest.mark.parametrize(
    ("change", "number"),
    [
        ({"around": 8}, 1),  # the mesh is not the same after a third of a turn: the mirror is left
        ({"around": 8, "angles_deg": (0, 90, 180, 270)}, 7),
        ({"angles_deg": (0, 120, 230)}, 0),
        ({"angles_deg": (0, 120)}, 1),
        ({"payload": Payload(mass=0.01, centre=(0.002, 0.0, 0.0))}, 1),
        ({"payload": Payload(mass=0.01)}, 5),
        ({"loads": (PointLoad(at=(0.009, 0.0, 0.05), mass=0.01),)}, 1),
        ({"cables": ()}, 0),
    ],
)
def test_a_model_that_is_not_the_same_from_every_side_has_fewer_symmetries(change, number):
    assert len(symmetries(RobotModel(tube(**change)))) == number


def test_cables_that_differ_have_no_symmetry_that_exchanges_them():
    one, *others = tube().cables
    assert len(symmetries(RobotModel(tube(cables=(dataclasses.replace(one, friction=0.2), *others))))) == 1


def test_a_flat_section_has_two_mirrors():
    segment = Segment("s", 0.1, section=Section("rectangle", 0.02, 0.012))
    cables = tuple(Cable(f"c{k}", angle=np.radians(a), radius=0.004, segment="s") for k, a in enumerate((0, 90, 180, 270)))
    assert len(symmetries(RobotModel(tube(segments=(segment,), cables=cables, around=8)))) == 3


def test_fewer_paths_are_followed_where_each_stands_for_its_images():
    model = RobotModel(tube(modulus=20e6))
    options, asked = TrainingOptions(paths=15, least=25, steps=1), []

    def enough(earlier: list, new: list) -> bool:
        asked.append((len(earlier), len(new)))
        return len(asked) == 2

    assert len(samples(model, options, enough=enough, turns=3)) == 13
    assert asked == [(5, 4), (9, 4)]


def test_gravity_turns_by_less_where_a_soft_robot_moves_far(monkeypatch):
    model, options = RobotModel(tube(modulus=1.5e4)), TrainingOptions(paths=4, steps=12)
    monkeypatch.setattr(module, "_RELEASED", 1.0)  # with cables, gravity also waits where the tip is far from its target
    lost = {}
    for farthest in (module._FARTHEST, 1e9):
        monkeypatch.setattr(module, "_FARTHEST", farthest)
        lost[farthest] = _lost(model, options, monkeypatch)
    few, many = lost.values()
    assert 2 * few < many


def _lost(model: RobotModel, options: TrainingOptions, monkeypatch: pytest.MonkeyPatch) -> int:
    """How many steps of the paths have no equilibrium."""
    shapes = []
    step = Simulator.step

    def noted(self: Simulator, *args, **options):
        shapes.append(step(self, *args, **options))
        return shapes[-1]

    with monkeypatch.context() as patch:
        patch.setattr(Simulator, "step", noted)
        samples(model, options)
    return sum(not shape.is_equilibrium for shape in shapes)
