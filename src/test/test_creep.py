"""Prony series: relaxation and creep against closed forms, memory from one equilibrium to the next, refused series."""

import dataclasses

import numpy as np
import pytest

from gravcomp.config import ConfigError, from_mapping
from gravcomp.description import Elements, Material, PronyTerm, load_robot_file
from gravcomp.full_model.creep import Creep
from gravcomp.full_model.viscosity import Viscosity
from gravcomp.mechanics.viscous_strain import ViscousStrain
from gravcomp.mesh import tube_mesh
from gravcomp.reduction.memory import Memory
from gravcomp.simulation import RobotModel, Simulator

GRAVITY = np.array([-9.81, 0.0, 0.0])
SERIES = (PronyTerm(0.1, 0.5), PronyTerm(0.2, 8.0))


def robot(**material):
    small = dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=4, along=4), cables=())
    return small.with_material(**material)


def test_a_stretched_body_relaxes_as_the_series_says():
    """After a sudden stretch that is held, the stress is E (1 + sum rho exp(-t / T)) = E_0 (1 - sum g (1 - exp(-t / T)))."""
    viscosity = Viscosity(tube_mesh(robot(prony=SERIES)))
    count = len(tube_mesh(robot()).elements)
    strain = np.full((count, 8, 6), 0.01)
    instant = viscosity.creep(0.0 * strain, viscosity.relaxed(strain), 1e-9)
    held = viscosity.held_after(strain, 0.0 * strain, viscosity.relaxed(strain), 1e-9)
    assert 1.0 + instant.factor == pytest.approx(np.full(count, 1.0 / 0.7), rel=1e-6)
    time = 0.0
    for h in (0.1, 0.1, 1.0, 5.0, 20.0):
        time += h
        viscous = viscosity.creep(strain, held, h)
        held = viscosity.held_after(strain, strain, held, h)
        stress = strain + viscous.factor[:, None, None] * strain - viscous.past
        left = 1.0 - 0.1 * (1.0 - np.exp(-time / 0.5)) - 0.2 * (1.0 - np.exp(-time / 8.0))
        assert stress == pytest.approx(strain * left / 0.7, rel=1e-6)


def test_a_loaded_body_creeps_as_the_standard_linear_solid():
    """A stiff robot sags little, so linearly: u = u_oo (1 - rho / (1 + rho) exp(-t / (T (1 + rho)))) with rho = g / (1 - g)."""
    stiff, share, time = robot(youngs_modulus=80e6), 0.25, 2.0
    simulator = Simulator(stiff.with_material(prony=(PronyTerm(share, time),)), reduced=False)
    lasting = Simulator(stiff, reduced=False).solve(GRAVITY).tip_position[0]
    simulator.step(GRAVITY, duration=1e-6)
    retarded = time / (1.0 - share)
    for step in range(1, 41):
        sag = simulator.step(GRAVITY, duration=0.1).tip_position[0]
        assert sag == pytest.approx(lasting * (1.0 - share * np.exp(-0.1 * step / retarded)), rel=2e-3)


def test_without_a_duration_the_body_has_relaxed():
    creeping, lasting = (Simulator(robot(prony=series), reduced=False) for series in (SERIES, ()))
    creeping.step(GRAVITY, duration=1e-3)
    expected = lasting.solve(GRAVITY).tip_position
    assert creeping.step(GRAVITY).tip_position == pytest.approx(expected, abs=1e-6)
    assert creeping.step(GRAVITY, duration=1e-3).tip_position == pytest.approx(expected, abs=1e-6)
    assert creeping.solve(GRAVITY).tip_position == pytest.approx(expected, abs=1e-6)
    with pytest.raises(ValueError, match="duration is 0"):
        creeping.step(GRAVITY, duration=0.0)


def test_one_branch_is_a_series_of_one_term():
    one, other = Material(creep_ratio=0.25, creep_time=3.0), Material(prony=(PronyTerm(0.2, 3.0),))
    assert np.array(one.branches) == pytest.approx(np.array(other.branches))


def test_a_memory_in_reduced_coordinates_is_that_of_the_body():
    """Two modes, bent one after the other at changing speed: the two moments of the course give every point's held strain."""
    model = RobotModel(robot(prony=SERIES))
    z = model.mesh.nodes[: model.n_free, 2] / model.length
    zero = np.zeros_like(z)
    basis = np.column_stack([np.stack(f, axis=1).ravel() for f in ((z**2, zero, -0.1 * z), (zero, z**3, 0.2 * z))])
    viscosity = Viscosity(model.mesh)

    def strains(q):
        u = np.zeros_like(model.mesh.nodes)
        model.free(u)[:] = basis @ q
        return model.elements.strains(u)

    memory = Memory.of(model.mesh.materials[0].branches, np.zeros(2), np.zeros(0))
    strain, held = strains(np.zeros(2)), viscosity.relaxed(strains(np.zeros(2)))
    for h, q in ((0.1, [0.03, 0.0]), (0.5, [0.03, 0.02]), (2.0, [-0.02, 0.03]), (0.2, [0.0, 0.01])):
        moved = strains(np.array(q))
        held, strain = viscosity.held_after(moved, strain, held, h), moved
        memory = memory.after(np.array(q), np.zeros(0), h)
    own_strain, own_held = memory.at_points(model.elements, basis)
    assert own_strain == pytest.approx(strain, abs=1e-12)
    assert own_held == pytest.approx(held, abs=1e-7 * np.abs(held).max())


@pytest.mark.parametrize(
    ("keys", "found"),
    [
        ({"prony": [{"share": 0.6, "time_s": 1.0}, {"share": 0.4, "time_s": 9.0}]}, "add up to 1; allowed: below 1"),
        ({"prony": [{"share": 1.0, "time_s": 1.0}]}, r"prony\[0\].share is 1.0; allowed: 1e-06 to 0.99"),
        ({"prony": [{"share": -0.1, "time_s": 1.0}]}, r"prony\[0\].share is -0.1"),
        ({"prony": [{"share": 0.1, "time_s": 0.0}]}, r"prony\[0\].time_s is 0.0; allowed: 0.001 to 1e\+07 s"),
        ({"prony": [{"share": 0.1, "time_s": 2.0}, {"share": 0.1, "time_s": 2.0}]}, "time 2 s 2 times"),
        ({"prony": [{"share": 0.1}]}, r"prony\[0\].time_s' is missing"),
        ({"prony": [{"share": 0.1, "time_s": 2.0}], "creep_ratio": 0.1}, "both given"),
        ({"prony": {"share": 0.1}}, "a list is needed"),
        ({"poissons_ratio": 0.5}, "poissons_ratio is 0.5; allowed: 0 to 0.4999"),
        ({"youngs_modulus_mpa": 0.0}, "youngs_modulus_mpa is 0.0; allowed: 0.001"),
        ({"youngs_modulus_mpa": -1.0}, "youngs_modulus_mpa is -1.0; allowed: 0.001"),
    ],
)
def test_wrong_constants_are_refused_with_key_and_range(keys, found):
    with pytest.raises(ConfigError, match=found):
        from_mapping(Material, keys, source="robot.yaml", key="robot.segments[0].material")


def test_a_nearly_incompressible_material_is_damped_as_a_less_incompressible_one_is():
    """A large strain without change of volume has tr E > 0, which lambda alone would resist: 55 mu at a ratio of 0.499."""
    stretch = 1.3
    forces = []
    for ratio in (0.45, 0.4999):
        model = RobotModel(robot(poissons_ratio=ratio))
        across = np.array([stretch**-0.5, stretch**-0.5, stretch]) - 1.0
        u = model.mesh.nodes * across
        strain = model.elements.strains(u)
        viscous = ViscousStrain(np.ones(len(strain)), np.zeros_like(strain), np.ones(len(strain), bool))
        force = model.elements.internal_force(u, viscous) - model.elements.internal_force(u)
        shear = 1.0 / (2.0 * (1.0 + ratio))  # over Young's modulus
        forces.append(np.abs(force[model.mesh.tip, 2].sum()) / shear)
    assert forces[1] == pytest.approx(forces[0], rel=1e-6)


@pytest.mark.parametrize("series", [SERIES, (PronyTerm(0.4, 0.5), PronyTerm(0.4, 8.0))], ids=["elastic", "mostly-viscous"])
def test_the_predicted_tangent_of_a_step_that_is_over_is_the_exact_one(series):
    """Also with what creep holds: without it Newton's method diverges on slender robots that creep."""
    model = RobotModel(robot(prony=series))
    bent = np.array([0.1, 0.0, 0.0]) * (model.mesh.nodes[:, 2:] ** 2 / model.length)
    creep = Creep(model)
    creep.relax(-bent)
    held = creep.step(0.5)
    exact, predicted, without = (model.new_matrix() for _ in range(3))
    model.elements.assemble(bent, exact, held)
    model.elements.assemble(bent, predicted, held, origin=bent.copy())
    model.elements.assemble(bent, without, dataclasses.replace(held, past=0.0 * held.past))
    scale = np.abs(exact.values).max()
    assert np.abs(predicted.values - exact.values).max() < 1e-9 * scale
    assert np.abs(without.values - exact.values).max() > 1e-4 * scale
