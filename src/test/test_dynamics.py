"""Motion: energy, settling at the equilibrium, order of the integrator, both kinds of damping."""

import dataclasses

import numpy as np
import pytest

from gravcomp.description import Elements, load_robot_file
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.dynamics import DynamicSolver
from gravcomp.simulation import DynamicSimulator, DynamicsOptions, RobotModel, ShapeStatus, Simulator

GRAVITY = np.array([-9.81, 0.0, 0.0])


def model(damping_time: float = 0.02, **material: float) -> RobotModel:
    robot = dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=4, along=4))
    return RobotModel(robot.with_material(damping_time=damping_time, **material))


def fall(solver: DynamicSolver, h: float, duration: float) -> np.ndarray:
    """Energies after every step of the robot let go straight."""
    solver.place(np.zeros_like(solver.model.mesh.nodes), gravity=GRAVITY)
    energies = []
    for _ in range(round(duration / h)):
        assert solver.step(GRAVITY, CableInput(), h).converged
        energies.append(solver.energy(GRAVITY))
    return np.array(energies)


def test_without_damping_energy_is_kept():
    solver = DynamicSolver(model(0.0), DynamicsOptions(spectral_radius=1.0))
    energy = fall(solver, 2e-3, 0.1)
    state = solver.state
    exchanged = abs(solver.model.free(state.u) @ solver.model.weight(GRAVITY))
    # The scheme conserves to second order in the step, not exactly.
    assert np.abs(energy).max() < 0.01 * exchanged


def test_damping_only_takes_energy_away():
    energy = fall(DynamicSolver(model(), DynamicsOptions()), 5e-3, 0.25)
    assert np.diff(energy).max() < 1e-3 * np.abs(energy).max()


def test_rayleigh_damping_takes_energy_from_a_robot_that_its_cables_compress():
    """Taut cables press the sagging body more than it bears without them: its own stiffness as damping would drive it."""
    robot = model()
    statics = Simulator(robot, reduced=False)
    rest = statics.solve(GRAVITY, displacement=np.zeros(6))
    _, cables = statics.checked(GRAVITY, np.zeros(6), None)
    solver = DynamicSolver(robot, DynamicsOptions(damping="rayleigh", rayleigh_mass=1.0, rayleigh_stiffness=0.1))
    sideways = np.zeros_like(robot.mesh.nodes)
    sideways[:, 1] = 1e-6 * (robot.mesh.nodes[:, 2] / robot.length) ** 2
    solver.place(statics.displacements + sideways, rest.cable_tension, GRAVITY)
    for _ in range(60):
        solver.step(GRAVITY, cables, 0.02)
    assert np.abs(solver.state.u - statics.displacements).max() < 0.1e-6


@pytest.mark.parametrize("damping", ["kelvin_voigt", "rayleigh"])
def test_it_settles_at_the_equilibrium(damping):
    robot = model(0.1)
    options = DynamicsOptions(damping=damping, rayleigh_mass=1.0, rayleigh_stiffness=0.1, time_step=0.02)
    simulator = DynamicSimulator(robot, options)
    for _ in range(75):
        shape = simulator.step(GRAVITY, displacement=np.zeros(6))
    rest = Simulator(robot, reduced=False).solve(GRAVITY, displacement=np.zeros(6))
    assert shape.tip_position == pytest.approx(rest.tip_position, abs=2e-5)
    assert shape.cable_tension == pytest.approx(rest.cable_tension, abs=2e-3)


def test_a_time_step_that_does_not_settle_is_halved():
    """Let go with little damping, the article's robot whips through its lowest point faster than steps of 10 ms follow."""
    robot = load_robot_file("article").robot.with_material(youngs_modulus=0.82e6, damping_time=0.015)
    simulator = DynamicSimulator(robot)
    simulator.reset()
    shapes = [simulator.step(GRAVITY) for _ in range(60)]
    assert all(shape.status == ShapeStatus.OK for shape in shapes)


def test_settled_motion_stays_at_the_equilibrium():
    simulator = DynamicSimulator(model())
    rest = simulator.settle(GRAVITY, np.zeros(6))
    moved = [simulator.step(GRAVITY, np.zeros(6)) for _ in range(5)][-1]
    assert moved.tip_position == pytest.approx(rest.tip_position, abs=1e-6)


def course(of: RobotModel, h: float = 5e-3, count: int = 60) -> np.ndarray:
    """(count, 3) tips of the robot let go straight."""
    simulator = DynamicSimulator(of, DynamicsOptions(time_step=h), reduced=False)
    simulator.let_go(GRAVITY)
    return np.array([simulator.step(GRAVITY).tip_position for _ in range(count)])


def test_creep_that_takes_forever_is_stiffness():
    creeping = model(0.01, creep_ratio=0.25, creep_time=1e4)
    stiffer = model(0.01 / 1.25, youngs_modulus=1.25 * 0.8e6)
    # In 0.3 s of 10,000 s, 30 millionths of the quarter creep away.
    assert course(creeping) == pytest.approx(course(stiffer), abs=2e-6)


def test_immediate_creep_is_damping():
    # The branch holds its strain for T, which is a damping time of rho T, with a lag of T.
    swing = course(model(0.01), h=2e-3, count=60)
    crept = course(model(0.006, creep_ratio=2.0, creep_time=2e-3), h=2e-3, count=60)
    without = course(model(0.006), h=2e-3, count=60)
    assert np.abs(crept - swing).max() < 0.2 * np.abs(without - swing).max()


def test_creep_does_not_change_where_the_robot_comes_to_rest():
    creeping = model(0.1, creep_ratio=0.3, creep_time=0.1)
    rest = Simulator(creeping, reduced=False).solve(GRAVITY)
    assert course(creeping, h=0.02, count=120)[-1] == pytest.approx(rest.tip_position, abs=5e-5)


def test_gravity_acts_from_the_moment_of_letting_go():
    """At first the tip of a falling rod accelerates by 1.5 g; if gravity started a step late, half the fall would be missing."""
    fine, coarse = course(model(0.01), h=1e-3, count=30), course(model(0.01), h=1e-2, count=3)
    assert coarse[-1] == pytest.approx(fine[-1], abs=0.3e-3)


def test_linear_tetrahedra_have_no_damping_of_their_own():
    from gravcomp.mesh import tube_mesh

    robot = load_robot_file("article").robot
    baseline = RobotModel(robot, tube_mesh(robot, "tet4", around=4, along=4))
    with pytest.raises(ValueError, match="rayleigh"):
        DynamicSolver(baseline)
