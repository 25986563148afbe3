"""Robots that are put into lumens from meshes, with friction, from the straight robot, which is in their walls."""

import numpy as np
import pytest

from gravcomp.bench.contact_lumens import mesh_lumen
from gravcomp.bench.contact_scenes import moved_robot, seeded_gravity
from gravcomp.bench.sampled_depth import sampled_depth
from gravcomp.contact.condensed import contact_forces
from gravcomp.contact.place_forces import turning
from gravcomp.contact.places import empty_places
from gravcomp.full_model.cable_input import CableInput
from gravcomp.simulation import RobotModel, Simulator


@pytest.fixture(scope="module")
def model():
    return RobotModel(moved_robot())


@pytest.mark.parametrize("seed", [9, 79, 99], ids=["limits go to and fro", "rough", "smooth"])
def test_a_robot_is_put_into_a_lumen_with_friction(model, seed):
    scene, gravity = mesh_lumen(seed, model.robot), seeded_gravity(seed)
    simulator = Simulator(model, reduced=False, scene=scene)
    contact = simulator.solver.contact
    assert contact.rubbing
    assert contact.depth(np.zeros_like(model.mesh.nodes)) > 2e-3
    shape = simulator.solve(gravity)
    assert shape.is_equilibrium and len(shape.contacts)
    assert contact.rubbing and contact.allowed == 0.0
    assert sampled_depth(contact, simulator.displacements) < 2e-5
    normal = shape.contacts.normal_force
    across = np.linalg.norm(shape.contacts.force - normal[:, None] * shape.contacts.normal, axis=1)
    assert (across <= np.sqrt(2.0) * 0.3 * normal * (1.0 + 1e-3)).all()
    assert simulator.step(gravity).is_equilibrium


def test_only_places_near_walls_count_while_the_walls_are_lowered(model):
    """At first the lowered walls touch the straight robot where it is deepest; most of it is far from them."""
    scene, gravity = mesh_lumen(59, model.robot), seeded_gravity(59)
    solver = Simulator(model, reduced=False, scene=scene).solver
    depth = solver.contact.depth(np.zeros_like(model.mesh.nodes))
    solver.contact.allowed = 0.95 * depth
    with solver.contact.without_friction():
        assert solver.track(0.01 * gravity, CableInput(), 15).converged
    places = solver.state.touch.solution[0]
    assert 0 < len(places.row) < 10


def test_an_equilibrium_without_friction_is_taken_where_none_is_found_on_the_way_with_it(model, monkeypatch):
    scene, gravity = mesh_lumen(49, model.robot), seeded_gravity(49)
    simulator = Simulator(model, reduced=False, scene=scene)
    solver = simulator.solver
    track = solver.track

    def lost_while_it_rubs(*arguments, fraction=1.0, **options):
        state = track(*arguments, fraction=fraction, **options)
        state.converged &= not (solver.contact.rubbing and 0.1 < fraction < 1.0)
        return state

    monkeypatch.setattr(solver, "track", lost_while_it_rubs)
    shape = simulator.solve(gravity)
    assert shape.is_equilibrium
    across = shape.contacts.force - shape.contacts.normal_force[:, None] * shape.contacts.normal
    assert np.abs(across).max() < 1e-4 * shape.contacts.normal_force.max()


def test_limits_of_friction_that_go_to_and_fro_meet_between():
    """A tip that slides in the corner of two faces: either of the limits that follow from the other leads to the first again."""
    lines = np.array([
        [0.013, -0.205, -1.248], [0.013, -0.515, -1.149], [0.001, -1.264, 0.212], [-0.061, -0.053, -0.262],
        [-0.001, -1.168, 0.533], [-0.06, -0.114, -0.261],
    ])  # fmt: skip
    compliance, free = lines @ lines.T, np.array([-30.1, -28.0, 4.1, -6.2, 11.7, -6.2])
    none, two = np.zeros(0), np.zeros(2)
    force, _, _, settled = contact_forces(
        compliance, free, none, none, none, two, two, np.full(2, 0.3), none, two, np.zeros((2, 2))
    )
    assert settled
    slack, rub = (compliance @ force + free)[:2], force[2:].reshape(2, 2)
    assert force[:2].min() >= 0.0 and slack.min() > -1e-4 and (force[:2] * slack).max() < 1e-3
    assert (np.abs(rub) <= 0.3 * force[:2, None] * (1.0 + 1e-5)).all()


def test_a_force_that_is_rounding_error_does_not_turn():
    places = empty_places(2)
    places.curvature[:] = 100.0
    turns, moves, stiffness = turning(places, np.array([1.0, 5e-324]))
    assert turns.tolist() == [0] and not len(moves)
    assert stiffness == pytest.approx([100.0])


def test_a_robot_slides_to_an_equilibrium_near_by_where_none_is_found_with_friction(model, monkeypatch):
    """A search from the straight robot found one half a millimetre off, to which the walls had to lift the robot."""
    scene, gravity = mesh_lumen(49, model.robot), seeded_gravity(49)
    simulator = Simulator(model, reduced=False, scene=scene)
    solver = simulator.solver
    assert simulator.solve(gravity).is_equilibrium
    before, track, turned = simulator.displacements.copy(), solver.track, gravity + np.array([0.0, 0.02, 0.0])

    def lost_while_it_rubs(*arguments, **options):
        state = track(*arguments, **options)
        state.converged &= not solver.contact.rubbing
        return state

    monkeypatch.setattr(solver, "track", lost_while_it_rubs)
    state = solver.approach(gravity, turned, CableInput())
    assert state.converged and solver.contact.rubbing
    assert 0.0 < np.abs(state.u - before).max() < 1e-3
