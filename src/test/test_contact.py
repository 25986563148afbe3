"""Contact: forces and states from the compliance, places on the surface, and equilibria of a robot that touches a scene."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

from gravcomp.bench.contact import slender_rod
from gravcomp.bench.contact_scenes import scene_of
from gravcomp.config import ConfigError
from gravcomp.contact.condensed import OPEN, SLIDING, STICKING, contact_forces
from gravcomp.contact.places import all_gaps
from gravcomp.contact.stability import unstable_motions
from gravcomp.description import Elements, load_robot_file
from gravcomp.full_model.contact import FullContact
from gravcomp.full_model.supports import SupportedFactor
from gravcomp.full_model.wrench import Wrench
from gravcomp.inverse import ControllerCode, InverseController, InverseOptions, Target, direction_weight, straight_target
from gravcomp.mesh import tube_mesh
from gravcomp.reduction.clear_of_obstacles import ClearOfObstacles
from gravcomp.references import calculix_contact
from gravcomp.references.calculix_contact import cylinder, stored_rests
from gravcomp.references.contact_beams import buckled_in_tube, over_peg
from gravcomp.simulation import RobotModel, Simulator

G = np.array([-9.81, 0.0, 0.0])


def forces(compliance, free, gap, friction=(), wound=(), tension=(), given=(), bend=()):
    c = len(gap)
    found, change, state, settled = contact_forces(
        np.asarray(compliance, dtype=float), np.asarray(free, dtype=float), np.asarray(wound, dtype=float),
        np.asarray(given, dtype=float), np.asarray(tension, dtype=float), np.asarray(gap, dtype=float), np.zeros(c),
        np.asarray(friction, dtype=float), np.asarray(bend, dtype=float), np.zeros(c), np.zeros((c, 2)),
    )  # fmt: skip
    assert settled
    return found, change, state


def random_compliance(rng, size, rank=None):
    factor = rng.standard_normal((size, rank or size))
    return factor @ factor.T


def test_normal_forces_and_tensions_are_complementary_to_gaps_and_slack():
    for seed in range(30):
        rng = np.random.default_rng(seed)
        m, c = 3, 6
        s = random_compliance(rng, m + c)
        free, gap, wound = rng.standard_normal(m + c), rng.uniform(0, 1, c), rng.standard_normal(m)
        found, _, state = forces(s, free, gap, wound=wound, tension=np.zeros(m))
        slack = s @ found + free + np.concatenate([-wound, gap])
        scale = np.abs(found).max()
        assert found.min() >= 0.0
        assert slack.min() >= -1e-5 * scale
        assert (found * slack).max() <= 1e-5 * scale**2
        assert ((state != OPEN) == (found[m:] > 0)).all()


def test_friction_sticks_below_its_limit_and_slides_against_the_motion_at_it():
    kinds = set()
    for seed in range(30):
        rng = np.random.default_rng(seed)
        c = 4
        s = random_compliance(rng, 3 * c)
        free, gap, friction = rng.standard_normal(3 * c), np.zeros(c), np.full(c, 0.3)
        found, _, state = forces(s, free, gap, friction)
        moved = s @ found + free
        normal, rub, slid = found[:c], found[c:].reshape(c, 2), moved[c:].reshape(c, 2)
        assert (np.abs(rub) <= 0.3 * normal[:, None] + 1e-4 * normal.max()).all()
        for i in range(c):
            kinds.add(int(state[i]))
            if state[i] == STICKING:
                assert np.abs(slid[i]).max() < 1e-4 * np.abs(free).max()
            if state[i] == SLIDING:
                assert (rub[i] * slid[i] <= 1e-6 * np.abs(free).max() * normal.max()).all()
    assert kinds == {OPEN, STICKING, SLIDING}


def test_more_places_than_the_body_can_move_share_the_force():
    """A stiff body on many places: S has a low rank, and the solution is found all the same."""
    rng = np.random.default_rng(1)
    c = 20
    factor = np.vstack([rng.uniform(0.5, 1.5, (c, 3)), rng.standard_normal((2 * c, 3))])
    s = factor @ factor.T
    found, _, _ = forces(s, -np.ones(3 * c) * np.repeat([1.0, 0.0], [c, 2 * c]), np.zeros(c), np.full(c, 0.2))
    response = s @ found - np.repeat([1.0, 0.0], [c, 2 * c])
    assert response[:c].min() > -1e-4


@pytest.fixture(scope="module")
def model():
    return RobotModel(dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=4, along=5)))


def in_scene(model, **kinds):
    return Simulator(model, reduced=False, scene=scene_of(**kinds))


def test_a_sum_without_a_minimum_is_given_up_before_its_forces_run_away():
    """Of a body that only walls keep from buckling: the farther the two places are pressed apart, the lower the sum."""
    force, _, _, settled = contact_forces(
        np.array([[1.0, -2.0], [-2.0, 1.0]]), np.full(2, -1.0), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(2), np.zeros(2),
        np.zeros(0), np.zeros(0), np.ones(2), np.zeros((2, 2)),
    )  # fmt: skip
    assert not settled
    assert np.abs(force).max() < 100.0


def test_a_sagging_robot_rests_on_a_plane_without_penetration(model):
    simulator = in_scene(model, planes=[{"normal": [1, 0, 0], "point_mm": [-15, 0, 0]}])
    shape = simulator.solve(G)
    assert shape.is_equilibrium
    assert simulator.solver.contact.depth(simulator.displacements) < 1e-6
    assert shape.contacts.normal_force.sum() > 1e-3
    # The clamp's reaction and the plane's force carry the weight.
    mesh_force = model.elements.internal_force(simulator.displacements)[model.n_free :].sum(axis=0)
    clamp = mesh_force - model.nodal_weight[model.n_free :].sum() * G
    assert clamp + shape.contacts.force.sum(axis=0) == pytest.approx(-model.mass * G, abs=1e-6)


def test_steps_without_contact_are_made_only_where_no_obstacle_is_near_on_the_way(model):
    """The body bends along x by one coordinate, next to a ball and over a table that turns with gravity."""
    ball = {"centre_mm": [-12, 0, 100], "radius_mm": 1}
    table = {"normal": [0, 0, 1], "point_mm": [0, 0, -30], "frame": "world"}
    full = FullContact(model, scene_of(spheres=[ball], planes=[table]))
    bent = np.zeros((1, *model.mesh.nodes.shape))
    bent[0, :, 0] = (model.mesh.nodes[:, 2] / model.length) ** 2
    change, start, skipped = full.changes(bent), np.zeros(1), 0
    clear = ClearOfObstacles(full, change)

    def gap(q, gravity):
        sections, arrays = full.sections_at_rest + change @ q, full.scene.under_gravity(gravity)
        reach, slots = np.full(len(sections), np.inf), (len(arrays.kind), len(sections))
        return all_gaps(
            arrays, full.surface, sections, reach, np.ones(slots, bool), np.zeros((*slots, 2)), np.zeros((*slots, 3))
        ).min()

    random = np.random.default_rng(0)
    for k in range(300):
        angle = 1.2 * np.sin(0.05 * k)  # the base turns downward, until the tip is in the table
        gravity, q = 9.81 * np.array([-np.cos(angle), 0.0, np.sin(angle)]), start + 1e-3 * random.standard_normal(1)
        if clear.stays_far(start, q, gravity):
            skipped += 1
            assert min(gap(start + share * (q - start), gravity) for share in np.linspace(0.0, 1.0, 5)) > full.margin
        start = np.clip(q, -0.008, 0.03)
    assert 50 < skipped < 290
    assert gap(np.zeros(1), G) > full.margin < gap(np.full(1, -0.025), G)
    assert not clear.stays_far(np.zeros(1), np.full(1, -0.025), G)  # past the ball


def test_friction_holds_a_robot_that_is_pushed_along_a_wall(model):
    planes = {"normal": [1, 0, 0], "point_mm": [-15, 0, 0]}
    tips = []
    for friction in (0.0, 2.0):
        simulator = in_scene(model, planes=[planes | {"friction": friction}])
        simulator.solve(G)
        simulator.step(G)
        before = simulator.step(G)
        shape = simulator.step(G + np.array([0.0, 0.05, 0.0]))
        tips.append(np.linalg.norm(shape.contacts.position[-1] - before.contacts.position[-1]))
        assert shape.is_equilibrium
        assert shape.contacts.sliding.all() == (friction == 0.0)
    assert tips[1] < 2e-2 * tips[0]  # the robot rolls a little where it sticks


def test_a_sagging_robot_is_found_whose_tip_rubs_on_a_plane(model):
    """At the end of the robot the place of contact stays where it is, however steeply the gap falls towards it."""
    planes = {"normal": [1, 0, 0], "point_mm": [-6.5, 0, 0]}
    for friction in (0.1, 1.0):
        shape = in_scene(model, planes=[planes | {"friction": friction}]).solve(G)
        assert shape.is_equilibrium
        rubbing = np.linalg.norm(shape.contacts.force[:, 1:], axis=1)
        assert 0.0 < rubbing.max() <= (friction + 1e-3) * shape.contacts.normal_force.max()


def test_a_robot_follows_a_curved_tube_that_the_straight_robot_would_cross(model):
    tube = {"points_mm": [[0, 0, -20], [0, 0, 20], [0, 8, 60], [0, 25, 110], [0, 35, 130]], "radius_mm": [6]}
    simulator = in_scene(model, tubes=[tube])
    assert simulator.solver.contact.depth(np.zeros_like(model.mesh.nodes)) > 5e-3
    shape = simulator.solve(G)
    assert shape.is_equilibrium
    assert simulator.solver.contact.depth(simulator.displacements) < 2e-5


def test_a_step_that_fails_leaves_no_forces_behind(model):
    """The shape that is kept has its own contacts, and the steps that follow are those of a robot that did not try."""
    results = []
    for tried in (False, True):
        plane = {"normal": [1, 0, 0], "point_mm": [-15, 0, 0], "friction": 0.3}
        simulator = Simulator(model, reduced=False, scene=scene_of(planes=[plane]), searches=False)
        simulator.solve(G)
        before = simulator.step(G)
        if tried:
            failed = simulator.step(G, tension=np.array([3e3, 0.0, 0.0, 0.0, 0.0, 0.0]))
            assert not failed.is_equilibrium
            assert failed.contacts.force == pytest.approx(before.contacts.force, abs=0.0)
        shape = simulator.step(G + np.array([0.0, 0.05, 0.0]))
        results.append(np.concatenate([shape.tip_position, shape.contacts.force.ravel()]))
    assert results[1] == pytest.approx(results[0], abs=1e-9)  # the factor of the tangent is not kept: rounding errors


def test_a_robot_does_not_stay_balanced_on_a_ball(model):
    """By symmetry there is an equilibrium on top of the ball, where friction may hold the robot. Without, it rolls off."""
    ball = {"centre_mm": [-16.0, 0.0, 80.0], "radius_mm": 3.0}
    on_top = in_scene(model, spheres=[ball | {"friction": 1.0}])
    on_top.solve(G)
    held = on_top.step(G)
    assert held.is_equilibrium and held.contacts.normal[0, 0] > 0.9
    free = in_scene(model, spheres=[ball])
    shape = free.solve(G)
    assert shape.is_equilibrium and shape.tip_position[0] < held.tip_position[0] - 1e-2
    disturbed = free.step(G + np.array([0.0, 0.02, 0.0]))
    assert disturbed.is_equilibrium and np.linalg.norm(disturbed.tip_position - shape.tip_position) < 1e-3


def test_contact_is_a_constraint_in_the_response_to_the_cables(model):
    simulator = in_scene(model, planes=[{"normal": [1, 0, 0], "point_mm": [-10, 0, 0]}])
    tension = np.array([0.0, 0.1, 0.05, 0.1, 0.0, 0.1])
    base = simulator.solve(G, tension=tension)
    step = np.array([0.0, 1e-4, 0.0, 2e-4, 0.0, 0.0])
    after = simulator.step(G, tension=tension + step)
    foreseen = base.response.compliance_ea[:3] @ step
    pressing, pressed = base.contacts.by_obstacle(), after.contacts.by_obstacle()
    assert pressing.names == ("plane 1",)
    assert pressed.force - pressing.force == pytest.approx(pressing.change @ step, rel=2e-2)
    assert after.tip_position - base.tip_position == pytest.approx(foreseen, abs=2e-2 * np.abs(foreseen).max())


def test_a_rod_over_a_peg_follows_the_closed_form():
    rod = slender_rod()
    stiffness, length, radius = 2e6 * np.pi * 4e-3**4 / 64, rod.length, 2e-3
    weight, gap, place = 8 * stiffness * 0.02 / length**3, 5e-4, 0.6 * length
    low = 1e3 * (-radius - gap - 1e-3)
    peg = {"points_mm": [[low, -50, 1e3 * place], [low, 50, 1e3 * place]], "radius_mm": [1], "side": "outside"}
    model = RobotModel(dataclasses.replace(rod, elements=Elements(around=4, along=12)))
    gravity = np.array([-weight * length / model.body_weight.sum(), 0.0, 0.0])
    shape = in_scene(model, tubes=[peg]).solve(gravity)
    force, tip = over_peg(weight, length, stiffness, gap, place)
    assert shape.contacts.force[:, 0].sum() == pytest.approx(force, rel=1e-2)
    assert -shape.tip_position[0] == pytest.approx(tip, rel=2e-2)


def test_a_rod_that_an_end_load_buckles_in_a_tube_follows_the_closed_form():
    """Without the tube this load has no equilibrium: only the wall makes the tangent positive definite."""
    rod = slender_rod()
    stiffness, length, clearance = 2e6 * np.pi * 4e-3**4 / 64, rod.length, 1e-3
    weight = 8 * stiffness * 0.02 / length**3
    model = RobotModel(dataclasses.replace(rod, elements=Elements(around=4, along=12)))
    tube = {"points_mm": [[0, 0, -10], [0, 0, 250]], "radius_mm": [1e3 * (2e-3 + clearance)]}
    simulator, load = in_scene(model, tubes=[tube]), 2.0 * np.pi**2 * stiffness / (4.0 * length**2)
    gravity = np.array([-weight * length / model.body_weight.sum(), 0.0, 0.0])
    shape = simulator.solve(gravity, wrench=Wrench(force=np.array([0.0, 0.0, -load])))
    assert shape.is_equilibrium and simulator.solver.contact.depth(simulator.displacements) < 2e-5
    force, tip = buckled_in_tube(weight, load, length, stiffness, clearance)
    assert shape.contacts.force[:, 0].sum() == pytest.approx(force, rel=1e-2)
    assert -shape.tip_position[0] == pytest.approx(tip, rel=1e-3)
    turned = Rotation.from_rotvec([0.0, 0.0, 0.02]).apply(gravity)
    shape = simulator.step(turned, wrench=Wrench(force=np.array([0.0, 0.0, -load])))
    assert shape.is_equilibrium and shape.tip_position[:2] == pytest.approx(tip * turned[:2] / np.linalg.norm(turned), abs=2e-5)


@pytest.mark.parametrize("case", ["independent", "a face on a plane", "at the clamp", "a force that is nearly 0"])
def test_the_motions_that_walls_allow_are_counted_where_they_would_grow(case):
    """Against the eigenvalues of the stiffness on these motions, for random bodies, walls and forces that turn."""
    rng, counts = np.random.default_rng(3), []
    for _ in range(60):
        a = rng.standard_normal((8, 8))
        a = a + a.T + 4.0 * np.eye(8)
        walls, turns, turning = rng.standard_normal((2, 8)), rng.standard_normal((2, 8)), 3.0 * rng.standard_normal(2)
        if case == "a face on a plane":  # its corners do not move independently
            walls = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]]) @ walls
        elif case == "at the clamp":
            walls = np.vstack([walls, np.zeros(8)])
        elif case == "a force that is nearly 0":
            turning[0] *= 1e-22
        rows = np.vstack([walls, turns])
        negative = int((np.linalg.eigvalsh(a) < 0.0).sum())
        found = unstable_motions(negative, rows @ np.linalg.solve(a, rows.T), turning)
        allowed = null_space(walls)
        on_walls = allowed.T @ (a - turns.T @ (turning[:, None] * turns)) @ allowed
        assert found == (np.linalg.eigvalsh(on_walls) < 0.0).sum()
        counts.append(found)
    assert {0, 1} <= set(counts)


def test_a_buckled_body_is_solved_as_if_nothing_supported_it():
    rng = np.random.default_rng(4)
    a, rows = np.diag([-0.3, 1.0, 2.0, 3.0]), rng.standard_normal((2, 4))
    held = SupportedFactor(Dense(a + 50.0 * rows.T @ rows), rows, 50.0)
    right = rng.standard_normal((4, 3))
    assert held.negative == 1
    assert held.solve(right) == pytest.approx(np.linalg.solve(a, right), abs=1e-9)


@dataclasses.dataclass
class Dense:
    """A factor of a small matrix."""

    matrix: np.ndarray

    def solve(self, right):
        return np.linalg.solve(self.matrix, right)


def test_walls_that_squeeze_the_robot_to_nothing_are_named(model):
    """Balls all around the robot: it cannot leave them sideways, and no pair of planes tells it before."""
    angle, far = np.arange(6) * np.pi / 3, [12.5, 13, 13, 13, 13, 13]
    ring = [
        {"name": f"ball {k}", "centre_mm": [far[k] * np.cos(angle[k]), far[k] * np.sin(angle[k]), 60], "radius_mm": 10}
        for k in range(6)
    ]
    contact = in_scene(model, spheres=ring).solver.contact
    sentence = contact.squeezed(np.zeros_like(model.mesh.nodes), G)
    assert "between the walls of 'ball 0' and 'ball 3' there are 5.5 mm" in sentence
    assert "60 mm from the base, where the robot needs 9 mm" in sentence
    assert in_scene(model, spheres=ring[:1]).solver.contact.squeezed(np.zeros_like(model.mesh.nodes), G) == ""


def test_the_face_of_the_tip_lies_flat_on_a_wall_ahead(model):
    """Gravity pulls the robot onto the wall; as it turns, what presses moves over the face, and nothing is lost."""
    simulator = in_scene(model, planes=[{"normal": [0, 0, -1], "point_mm": [0, 0, 1e3 * model.length + 0.05], "friction": 0.3}])
    shape = simulator.solve(-9.81 * np.array([0.0, 0.0, -1.0]))
    assert shape.is_equilibrium and len(shape.contacts) > 2
    assert -shape.contacts.force[:, 2].sum() == pytest.approx(8.3e-3, rel=0.1)  # what more of the weight would stretch it
    centre = (shape.contacts.position * shape.contacts.normal_force[:, None]).sum(axis=0) / shape.contacts.normal_force.sum()
    assert np.linalg.norm(centre[:2]) < 1e-4
    for step in range(1, 5):
        shape = simulator.step(9.81 * np.array([-np.sin(3e-3 * step), 0.0, np.cos(3e-3 * step)]))
        assert shape.is_equilibrium
        assert simulator.solver.contact.depth(simulator.displacements) < 2e-5


@pytest.mark.parametrize("rest", stored_rests()[1:], ids=lambda rest: f"{1e3 * rest.gap:g} mm")
def test_a_cylinder_rests_on_a_plane_as_calculix_finds_it(rest):
    model, low = RobotModel(cylinder()), -0.5e3 * cylinder().segments[0].outer_diameter
    shape = in_scene(model, planes=[{"normal": [1, 0, 0], "point_mm": [low - 1e3 * rest.gap, 0, 0]}]).solve(G)
    assert shape.is_equilibrium
    assert shape.contacts.normal_force.sum() == pytest.approx(rest.force, rel=5e-3)
    assert np.linalg.norm(shape.tip_position - [0.0, 0.0, model.length] - rest.tip) < 1e-3 * model.length


def test_the_deck_of_calculix_has_a_gap_under_each_node_of_the_lowest_line():
    mesh = tube_mesh(cylinder())
    lines = calculix_contact.deck(mesh, 5e-3).splitlines()
    start = lines.index("*ELEMENT, TYPE=GAPUNI, ELSET=GAPS") + 1
    pairs = [[int(x) - 1 for x in line.split(",")[1:]] for line in lines[start : lines.index("*NSET, NSET=GROUND")]]
    assert len(pairs) == 24 and lines[lines.index("*GAP, ELSET=GAPS") + 1].startswith("5.000000000e-03, 1.0, 0.0, 0.0")
    ground, node = pairs[-1]
    place = [float(x) for x in lines[lines.index("*NODE, NSET=ALL") + 1 + ground].split(",")[1:]]
    assert place == pytest.approx(mesh.nodes[node] - [5e-3, 0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(
    ("kinds", "message"),
    [
        ({"planes": [{"normal": [1, 0, 0], "point_mm": [-3, 0, 0]}]}, "starts 1.5 mm inside 'plane 1'"),
        ({"tubes": [{"points_mm": [[0, 0, -10], [0, 0, 200]], "radius_mm": [9, 4]}]}, "radius of 'tube 1' is 4 mm"),
        (
            {"planes": [{"frame": "world", "normal": [0, 0, z], "point_mm": [0, 0, -3 * z]} for z in (1, -1)]},
            "between the walls of 'plane 1' and 'plane 2' there are 6 mm; the robot needs more than its diameter, 9 mm",
        ),
        ({"spheres": [{"frame": "world", "centre_mm": [0, 0, -5], "radius_mm": 7}]}, "starts 2 mm inside 'sphere 1'"),
        ({"boxes": [{"centre_mm": [0, 0, 60], "size_mm": [40, 8, 300], "side": "inside"}]}, "walls of 'box 1' there are 8 mm"),
    ],
)
def test_a_scene_that_leaves_no_room_for_the_robot_is_refused(model, kinds, message):
    with pytest.raises(ConfigError, match=message):
        in_scene(model, **kinds)


def test_a_target_behind_a_wall_gives_the_nearest_shape_and_its_force_is_bounded(model):
    """The message names the wall. With a bound on the force the robot, which leans on the wall already, presses less."""
    simulator = in_scene(model, planes=[{"name": "table", "normal": [1, 0, 0], "point_mm": [-15, 0, 0]}])
    controller, shape = InverseController(model.robot, scene=simulator.scene), simulator.solve(G)
    behind, forces, distances = Target(np.array([-0.02, 0.0, 0.095])), [], []
    for step in range(85):
        if step == 50:
            controller.options = InverseOptions(max_contact_force=0.5 * forces[-1])
        command = controller.step(
            shape.response, behind, backbone_station=shape.backbone_station, tension=shape.cable_tension, interval=0.02,
            followed=shape.is_equilibrium, contact=shape.contacts.by_obstacle(),
        )  # fmt: skip
        shape = simulator.step(G, command.displacement)
        forces.append(shape.contacts.normal_force.sum())
        distances.append(command.distance)
        if step in (49, 84):
            assert command.code == ControllerCode.CONTACT
            assert "leans on 'table' at (" in command.message
            assert simulator.solver.contact.depth(simulator.displacements) < 2e-5
            assert command.forces.names == ("table",) and command.forces.force == pytest.approx([forces[-1]], rel=1e-2)
    assert forces[49] > 1e-3
    assert distances[-1] < 1.05 * min(distances)  # the cables do not pull the robot together to come nearer across it
    assert forces[-1] < 1.02 * controller.options.max_contact_force
    assert "the force on 'table' is held; max_contact_force is" in command.message


def test_a_robot_that_lies_on_a_wall_is_lifted_to_a_target_in_free_space(model):
    """What touches goes on touching in the response, which has no motion off the wall."""
    simulator = in_scene(model, planes=[{"name": "table", "normal": [1, 0, 0], "point_mm": [-15, 0, 0]}])
    controller, shape = InverseController(model.robot, scene=simulator.scene), simulator.solve(G)
    target = straight_target(model.length, tip_direction_weight=direction_weight(model.length))
    assert len(shape.contacts) and shape.tip_position[0] < -5e-3
    for _ in range(40):
        command = controller.step(
            shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension, interval=0.02,
            followed=shape.is_equilibrium, contact=shape.contacts.by_obstacle(),
        )  # fmt: skip
        shape = simulator.step(G, command.displacement)
    assert not len(shape.contacts) and np.hypot(*shape.tip_position[:2]) < 0.3e-3
    assert command.code == ControllerCode.OK
