"""Static equilibrium of whole robots: balance, small loads, symmetry, cables, slack, and the linear answer."""

import dataclasses

import numpy as np
import pytest

from gravcomp.description import Elements, Material, Payload, Robot, Segment, load_robot_file
from gravcomp.full_model.applied_load import AppliedLoad
from gravcomp.full_model.law_range import beyond_range
from gravcomp.full_model.shifted_factor import ShiftedFactor
from gravcomp.full_model.statics import StaticSolver
from gravcomp.inverse import InverseController, straight_target
from gravcomp.mechanics.block_matrix import BlockMatrix, NotPositiveDefinite
from gravcomp.mechanics.total_lagrangian import SolidElements
from gravcomp.simulation import RobotModel, ShapeStatus, Simulator

G = 9.81
# The article's robot in few elements: what is shown here holds in each mesh.
ARTICLE = dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=6, along=4))


@pytest.fixture(scope="module")
def simulator():
    return Simulator(ARTICLE, reduced=False)


def test_the_clamp_carries_the_weight(simulator):
    simulator.solve([-G, 0.0, 0.0])
    model = simulator.model
    force = model.elements.internal_force(simulator.displacements)
    clamped = slice(model.n_free, None)
    reaction = force[clamped].sum(axis=0) - model.nodal_weight[clamped].sum() * np.array([-G, 0.0, 0.0])
    assert reaction == pytest.approx([model.mass * G, 0.0, 0.0], abs=1e-8)


def test_small_loads_follow_euler_bernoulli(simulator):
    tiny, robot = 1e-3 * G, simulator.robot
    outer, inner = robot.segments[0].outer_diameter, robot.segments[0].lumen_diameter
    stiffness = 0.8e6 * np.pi * (outer**4 - inner**4) / 64
    load = simulator.model.mass / robot.length * tiny
    sag = -simulator.solve([-tiny, 0.0, 0.0]).tip_position[0]
    # Shear adds about 4 E I / (k G A L^2) = 2 %, the clamp's held lateral contraction takes a little away.
    assert sag == pytest.approx(load * robot.length**4 / (8 * stiffness), rel=0.03)


def test_turning_gravity_and_cables_by_120_degrees_turns_the_shape(simulator):
    angle = np.deg2rad(120.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    gravity, tension = np.array([-6.0, 2.0, -5.0]), np.array([0.3, 0.0, 0.1, 0.2, 0.05, 0.0])
    one = simulator.solve(gravity, tension=tension)
    other = simulator.solve(turn @ gravity, tension=np.concatenate([np.roll(tension[:3], 1), np.roll(tension[3:], 1)]))
    assert other.backbone_position == pytest.approx(one.backbone_position @ turn.T, abs=1e-9)


def test_displacement_and_tension_are_two_sides_of_one_shape(simulator):
    tension = np.array([0.3, 0.1, 0.05, 0.2, 0.1, 0.15])
    pulled = simulator.solve([-G, 0.0, 0.0], tension=tension)
    wound = simulator.solve([-G, 0.0, 0.0], displacement=pulled.cable_displacement)
    assert wound.cable_tension == pytest.approx(tension, abs=1e-5)
    assert wound.tip_position == pytest.approx(pulled.tip_position, abs=1e-7)


def test_axially_soft_cables_are_wound_in_further():
    soft = dataclasses.replace(
        ARTICLE, cables=tuple(dataclasses.replace(c.without_line(), axial_stiffness=100.0) for c in ARTICLE.cables)
    )
    simulator = Simulator(soft, reduced=False)
    tension = np.full(6, 0.2)
    shape = simulator.solve([0.0, 0.0, -G], tension=tension)
    path = simulator.solver.state.tendons.displacement
    assert shape.cable_displacement - path == pytest.approx(np.array([0.05] * 3 + [0.1] * 3) * 0.2 / 100.0, rel=1e-6)


def test_released_cables_are_free(simulator):
    released = simulator.solve([-G, 0.0, 0.0])
    by_name = simulator.solve([-G, 0.0, 0.0], displacement=np.full(6, np.nan))
    assert by_name.tip_position == pytest.approx(released.tip_position, abs=1e-12)
    assert not by_name.cable_tension.any()


def test_the_response_is_the_derivative(simulator):
    gravity, tension, h = [-G, 0.0, 0.0], np.array([0.3, 0.05, 0.05, 0.2, 0.1, 0.05]), 1e-4
    response = simulator.solve(gravity, tension=tension).response

    def observed(tension):
        shape = simulator.solve(gravity, tension=tension)
        effector = [shape.tip_position, shape.tip_direction, shape.backbone_position.ravel()]
        return shape.cable_displacement, np.concatenate(effector)

    here = observed(tension)
    assert response.compliance_aa @ tension + response.displacement_free == pytest.approx(here[0], abs=1e-9)
    assert response.compliance_ea @ tension + response.effector_free == pytest.approx(here[1], abs=1e-7)
    for cable in (0, 4):
        step = h * np.eye(6)[cable]
        more, less = observed(tension + step), observed(tension - step)
        for compliance, one, other in zip((response.compliance_aa, response.compliance_ea), more, less):
            difference = (one - other) / (2 * h)
            # The response is that of the last but one iterate: equal up to what the last correction turned.
            assert compliance[:, cable] == pytest.approx(difference, abs=1e-3 * np.abs(difference).max())


def test_tracking_equals_solving(simulator):
    simulator.reset()
    for step in range(30):
        angle = np.deg2rad(3 * step)
        gravity = -G * np.array([np.cos(angle), 0.0, np.sin(angle)])
        shape = simulator.step(gravity, displacement=np.zeros(6))
    assert shape.tip_position == pytest.approx(simulator.solve(gravity, displacement=np.zeros(6)).tip_position, abs=1e-6)


def test_slack_is_entered_and_left_without_chatter(simulator):
    """Pulling one cable of the upright robot in and out again, it and the one opposite go taut and slack once each."""
    simulator.reset()
    pull = 1.5e-3 * np.sin(np.linspace(0.0, np.pi, 61))
    shapes = [simulator.step([0.0, 0.0, -G], displacement=np.array([p, 0, 0, 0, 0, 0])) for p in pull]
    taut = np.array([shape.cable_tension > 1e-9 for shape in shapes])
    assert np.abs(np.diff(taut.astype(int), axis=0)).sum(axis=0).tolist() == [2, 0, 0, 0, 2, 0]
    assert all(shape.status == ShapeStatus.OK for shape in shapes)
    # There and back, the shapes agree within the solver's tolerance, a millionth of the length.
    tips = np.array([shape.tip_position for shape in shapes])
    assert tips[:30] == pytest.approx(tips[:30:-1], abs=2e-7)


@pytest.mark.parametrize(
    ("law", "tension"), [("svk", 1.0), ("svk", 2.0), ("svk", 2.8), ("neo_hookean", 3.0), ("neo_hookean", 5.0)]
)
def test_far_equilibria_are_found_from_the_straight_robot(simulator, law, tension):
    far = simulator if law == "svk" else Simulator(simulator.robot.with_material(law=law), reduced=False)
    shape = far.solve([-G, 0.0, 0.0], tension=np.array([tension, 0, 0, 0, 0, 0]))
    assert shape.status == ShapeStatus.OK and shape.residual < 1e-6


def test_a_load_beyond_the_limit_is_reported_with_its_reason(simulator):
    """On the way to 4 N the branch ends at 3.3 N: the compressed side falls below 1 / sqrt(3) of its length, and folds."""
    before = simulator.solve([-G, 0.0, 0.0])
    shape = simulator.step([-G, 0.0, 0.0], tension=np.array([4.0, 0, 0, 0, 0, 0]))
    assert shape.status == ShapeStatus.NOT_CONVERGED
    assert "law 'svk' softens" in shape.message
    assert 3.1 < shape.cable_tension[0] < 3.4
    after = simulator.step([-G, 0.0, 0.0])
    assert after.status == ShapeStatus.OK and after.tip_position == pytest.approx(before.tip_position, abs=1e-6)


def test_searches_for_an_equilibrium_that_does_not_exist_become_rare(monkeypatch):
    """A loop cannot wait a second at every sample: between searches the last shape is kept, and the loop can return."""
    simulator = Simulator(ARTICLE, reduced=False)
    held, beyond = simulator.solve([-G, 0.0, 0.0]), np.array([4.0, 0, 0, 0, 0, 0])
    lost = [simulator.step([-G, 0.0, 0.0], tension=beyond) for _ in range(2)]
    with monkeypatch.context() as patch:  # the same failure without its cost
        failed, searches = dataclasses.replace(simulator.solver.state, converged=False), []
        patch.setattr(simulator.solver, "track", lambda *a, **k: failed)
        patch.setattr(
            simulator.solver, "solve", lambda *a, **_: searches.append(1) or dataclasses.replace(failed, load_fraction=0.9)
        )
        lost += [simulator.step([-G, 0.0, 0.0], tension=beyond) for _ in range(58)]
        assert len(searches) == 1
        lost += [simulator.step([-G, 0.0, 0.0], tension=beyond) for _ in range(60)]
        assert len(searches) == 1
    assert {shape.status for shape in lost} == {ShapeStatus.NOT_CONVERGED}
    assert "beyond" in lost[0].message and "is kept" in lost[1].message
    assert lost[1].tip_position == pytest.approx(held.tip_position)
    back = simulator.step([-G, 0.0, 0.0])
    assert back.status == ShapeStatus.OK and back.tip_position == pytest.approx(held.tip_position, abs=1e-6)


def test_an_equilibrium_lost_by_a_small_step_is_not_searched_for_immediately(monkeypatch):
    """The controller can take the step back; a search would delay the loop by a second."""
    simulator = Simulator(ARTICLE, reduced=False)
    gravity, wound = [0.0, 0.0, -G], np.array([5.0, 0.0, 0.0, 0.0, 0.0, 0.0]) * 1e-3
    held = simulator.solve(gravity, wound)
    assert held.is_equilibrium
    searches = []
    monkeypatch.setattr(simulator.solver, "solve", lambda *a, **_: searches.append(1) or simulator.solver.state)
    monkeypatch.setattr(simulator.solver, "track", lambda *a, **k: dataclasses.replace(simulator.solver.state, converged=False))
    lost = [simulator.step(gravity, wound + 1e-4) for _ in range(45)]
    assert not searches and not any(shape.is_equilibrium for shape in lost)
    assert lost[-1].tip_position == pytest.approx(held.tip_position)
    for _ in range(10):
        simulator.step(gravity, wound + 1e-4)
    assert len(searches) == 1
    simulator.reset()
    simulator.step(gravity, wound)
    assert len(searches) == 2  # from the straight robot it is a jump


def test_a_jump_of_the_load_is_followed_in_parts_without_a_search_from_the_straight_robot(simulator, monkeypatch):
    """A loop that waits a second for its model takes a longer step next, and waits again."""
    before, after = [-G, 0.0, 0.0], np.array([0.0, -G, 0.0])
    pulled = np.array([6e-3, 0.0, 0.0, -4e-3, 0.0, 0.0])
    wanted = simulator.solve(after, displacement=pulled)
    simulator.solve(before, displacement=np.zeros(6))
    track, steps = simulator.solver.track, []

    def in_short_steps(gravity, cables, *arguments, **options):
        """Follow a quarter of the gravity at most."""
        turned = np.linalg.norm(gravity - (steps[-1] if steps else np.array(before)))
        state = track(gravity, cables, *arguments, **options)
        if turned > 0.26 * G:
            return dataclasses.replace(state, converged=False)
        steps.append(gravity)
        return state

    monkeypatch.setattr(simulator.solver, "track", in_short_steps)
    monkeypatch.setattr(simulator.solver, "solve", lambda *a: pytest.fail("searched from the straight robot"))
    followed = simulator.step(after, displacement=pulled)
    assert followed.is_equilibrium and len(steps) > 5
    assert followed.tip_position == pytest.approx(wanted.tip_position, abs=1e-6)


def test_a_load_that_crushes_an_element_in_one_step_is_applied_in_parts():
    """Newton's method with the whole load gives an iterate that is not finite."""
    robot = load_robot_file("article").robot.with_material(law="neo_hookean")  # in longer elements it buckles
    shape = Simulator(robot, reduced=False).step([0.0, 0.0, -G], np.array([17.0, 0.0, 0.0, 17.0, 0.0, 17.0]) * 1e-3)
    assert shape.status == ShapeStatus.OK and shape.residual < 1e-6


def test_a_payload_is_carried(simulator):
    robot = dataclasses.replace(simulator.robot, payload=Payload(0.002))
    loaded = Simulator(robot, reduced=False)
    assert loaded.model.mass == pytest.approx(simulator.model.mass + 0.002)
    assert loaded.solve([-G, 0, 0]).tip_position[0] < simulator.solve([-G, 0, 0]).tip_position[0] - 0.01


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"tension": [1.0]}, r"tension has the shape \(1,\); \(6,\)"),
        ({"tension": [-1.0] + [0.0] * 5}, "cannot push"),
        ({"displacement": [np.inf] + [0.0] * 5}, "finite"),
        ({"displacement": np.zeros(6), "tension": np.zeros(6)}, "both given"),
    ],
)
def test_wrong_input_is_named(simulator, arguments, words):
    with pytest.raises(ValueError, match=words):
        simulator.step([0.0, 0.0, -G], **arguments)


def test_an_unloaded_robot_at_rest_stays_there(simulator):
    simulator.reset()
    for displacement in (np.zeros(6), None, None):
        shape = simulator.step(np.zeros(3), displacement)
        assert shape.status == ShapeStatus.OK
        assert shape.tip_position == pytest.approx([0.0, 0.0, 0.1], abs=1e-12)
        assert np.diag(shape.response.compliance_aa).min() > 0.0


def test_tracking_with_factors_of_earlier_steps_gives_the_shapes_of_new_factors(monkeypatch):
    """In the closed loop with gravity turning at 10 deg/s: the same shape and nearly the same response, with fewer factors."""
    follower, fresh = (Simulator(ARTICLE, reduced=False) for _ in range(2))
    controller, target = InverseController(follower.robot), straight_target(follower.robot.length)
    factors, factor = [], BlockMatrix.factor
    monkeypatch.setattr(BlockMatrix, "factor", lambda matrix: factors.append(1) or factor(matrix))
    wound, used, steps, settled = None, 0, 80, 40
    for k in range(steps):
        angle = np.radians(0.1 * k)
        gravity = -G * np.array([np.cos(angle), np.sin(angle), 0.0])
        before, given = len(factors), wound
        shape = follower.step(gravity, given)
        used += (len(factors) - before) * (k >= settled)
        assert shape.status == ShapeStatus.OK
        wound = controller.step(
            shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension
        ).displacement
    exact = fresh.solve(gravity, given)
    assert shape.backbone_position == pytest.approx(exact.backbone_position, abs=1e-6)
    assert shape.cable_tension == pytest.approx(exact.cable_tension, abs=1e-4)
    # The response of a factor whose corrections shrink tenfold is accurate to a tenth.
    largest = np.abs(exact.response.compliance_ea).max()
    assert shape.response.compliance_ea == pytest.approx(exact.response.compliance_ea, abs=0.1 * largest)
    assert used < (steps - settled) / 2


@pytest.mark.parametrize(("law", "message"), [("svk", "compressed to 55 %"), ("neo_hookean", "")])
def test_a_shape_beyond_the_range_of_its_law_is_reported(law, message):
    model = RobotModel(ARTICLE.with_material(law=law))
    u = np.zeros_like(model.mesh.nodes)
    u[:, 2] = -0.45 * model.mesh.nodes[:, 2]
    assert message in beyond_range(model, u) and bool(beyond_range(model, u)) == bool(message)
    assert not beyond_range(model, 0.5 * u)


def test_a_tangent_that_fails_again_is_assembled_once(simulator, monkeypatch):
    """A first failure, whose tangent has to be assembled again, does not count."""
    tracker, assembled, factor = StaticSolver(simulator.model), [], BlockMatrix.factor

    def failing(matrix: BlockMatrix):
        """Fail without a shift."""
        factors.append(1)
        if len(factors) == 1:
            matrix.values[:] = np.nan
            raise NotPositiveDefinite
        return factor(matrix)

    assemble, factors = SolidElements.assemble, []
    monkeypatch.setattr(SolidElements, "assemble", lambda *args: assembled.append(1) or assemble(*args))
    monkeypatch.setattr(BlockMatrix, "factor", failing)
    load = AppliedLoad(simulator.model.weight(np.array([0.0, 0.0, -9.81])), None, 1.0)
    solved = []
    for expected in (2, 1, 1):
        assembled.clear(), factors.clear()
        found, _, exact = tracker._new_factor(tracker.state, load, None, stable=False)
        solved.append(found.solve(np.ones(simulator.model.pattern.n)))
        assert len(assembled) == expected and not exact
    assert solved[1] == pytest.approx(solved[0], rel=1e-9) and solved[2] == pytest.approx(solved[0], rel=1e-9)


def test_an_indefinite_tangent_gets_the_smallest_shift_that_helps_with_two_factorisations_where_the_last_one_is_still_it(
    simulator, monkeypatch
):
    model, factors, factor = simulator.model, [], BlockMatrix.factor
    matrix, force = model.new_matrix(), np.ones(model.pattern.n)
    model.elements.assemble(np.zeros_like(model.mesh.nodes), matrix)
    definite, unit = matrix.values.copy(), matrix.mean_diagonal()
    monkeypatch.setattr(BlockMatrix, "factor", lambda matrix: factors.append(1) or factor(matrix))
    shifted = ShiftedFactor(matrix, unit)

    def lack(share: float, shift: float = 0.0) -> None:
        """Set the tangent that lacks a share of the unit on its diagonal, with a shift."""
        matrix.values[:] = definite
        matrix.add_diagonal((shift - share) * unit)

    # Tangents that need more, the same, less, as little as there is, and most.
    for share, power, most in ((0.5e-3, -3, 4), (0.4e-3, -3, 2), (0.5e-4, -4, 3), (0.5e-6, -6, 3), (0.5e-6, -6, 1), (0.5, 0, 7)):
        lack(share, shift=10.0**power)
        expected = factor(matrix).solve(force)
        lack(share)
        factors.clear()
        assert shifted.factor().solve(force) == pytest.approx(expected, rel=1e-6) and len(factors) <= most
    lack(2.0)
    with pytest.raises(NotPositiveDefinite, match="with any shift"):
        shifted.factor()


def test_a_soft_robot_hangs_down_although_it_sags_by_many_lengths_linearly():
    """500 mm of 0.05 MPa: its linear response is 37 lengths; the beam hangs below a bend at its clamp."""
    material = Material(youngs_modulus=0.05e6, poissons_ratio=0.49, density=1050.0)
    segment = Segment("s", length=0.5, outer_diameter=25e-3, lumen_diameter=8e-3, material=material)
    robot = Robot("soft", segments=(segment,), elements=Elements(around=6, along=6))
    shape = Simulator(robot, reduced=False).solve([-G, 0.0, 0.0])
    assert shape.is_equilibrium and shape.tip_position[0] < -0.45 and abs(shape.tip_position[2]) < 0.1
