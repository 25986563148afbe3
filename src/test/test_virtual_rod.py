"""The rod at rest: against three-dimensional finite elements, and its derivatives against finite differences."""

import dataclasses
import math

import numpy as np
import pytest
from virtual_article import article, horizontal, reference_robot, true_robot, with_body

from gravcomp.description import Fibres, Material
from gravcomp.references import calculix
from gravcomp.virtual.band_solver import newton_step
from gravcomp.virtual.body import build_rod
from gravcomp.virtual.equilibrium import equilibrium
from gravcomp.virtual.forces import assemble, half_bandwidth
from gravcomp.virtual.law_curve import curve_of_law, filaments
from gravcomp.virtual.rod import strains
from gravcomp.virtual.routing import tendon_lengths
from gravcomp.virtual.se3 import advance, motion_exp, motion_log


def rod(law="svk", **changes):
    robot = reference_robot().with_material(law=law)
    return build_rod(true_robot(robot, with_body(**({"density": 1150.0, "poissons_ratio": 0.45} | changes))))


def forces(model, orientation, position, tension):
    """Residual of the free cross-sections, band, gradient and path lengths at a state."""
    n, m = model.elements, model.tendons
    strain, path = np.empty((n, 6)), np.empty((m, n))
    direction, chord = model.scratch()
    gradient, pull = np.empty((6 * n, m)), np.empty((6 * n, m))
    band = np.empty((6 * n, 2 * half_bandwidth(model.routing.reach) + 1))
    strains(orientation, position, model.length, strain)
    tendon_lengths(orientation, position, strain, model.length, model.routing, direction, chord, path)
    residual = assemble(
        orientation,
        model.length,
        strain,
        model.rest_strain,
        model.stiffness,
        np.zeros((n, 6)),
        model.filament,
        model.curve,
        np.zeros(n),
        np.zeros(n),
        np.zeros((n, 2)),
        model.routing,
        direction,
        chord,
        path,
        tension,
        np.ones((m, n)),
        model.mass[:, None] * horizontal(),
        model.centre,
        gradient,
        pull,
        band,
    )
    return residual[1:].ravel(), band, gradient, pull, path.sum(axis=1)


@pytest.mark.parametrize("law", ["svk", "neo_hookean"])
def test_tip_agrees_with_calculix_without_cables(law):
    # The two laws of the table differ by up to 0.48 mm; with a clamp 15 % too short the rod is 0.15 mm off.
    worst = 0.0
    for row in (row for row in calculix.stored_rows() if row.law == law):
        model = rod(youngs_modulus=row.youngs_modulus, poissons_ratio=row.poissons_ratio, law=law)
        shape = equilibrium(model, 9.81 * np.array([-math.cos(row.inclination), 0.0, -math.sin(row.inclination)]))
        worst = max(worst, float(np.linalg.norm(shape.tip - [0.0, 0.0, 0.1] - row.tip)))
    assert worst < 0.12e-3


@pytest.mark.parametrize(
    ("law", "constants", "c", "d"),
    [
        ("svk", {}, 1.5, 0.5),
        ("neo_hookean", {}, -1.0, 4 / 3),
        ("mooney_rivlin", {"c01_ratio": 0.25}, -1.2, None),
        ("mooney_rivlin", {"c01_ratio": 1.0}, -1.5, None),
        ("yeoh", {"c20_ratio": 0.5}, -1.0, 4 / 3 + 3.0),
    ],
)
def test_a_filament_stiffens_with_its_strain_as_the_described_law_says(law, constants, c, d):
    found = curve_of_law(Material(law=law, youngs_modulus=0.3e6, poissons_ratio=0.4999, **constants))
    assert found[0] == pytest.approx(c, abs=0.01)
    assert d is None or found[1] == pytest.approx(d, abs=0.02)


@pytest.mark.parametrize(("ratio", "angle"), [(6.0, 0.0), (6.0, 0.6), (30.0, 0.9), (4.0, math.pi / 2)])
def test_a_filament_with_fibres_has_the_modulus_of_a_bar_that_may_contract(ratio, angle):
    material = Material(law="svk", youngs_modulus=0.3e6, poissons_ratio=0.45, fibres=Fibres(ratio, angle))
    strength = np.array([0.0, math.sin(angle) ** 2, math.cos(angle) ** 2])  # across the wall, around, along
    matrix = 0.3e6 / 1.45 * (np.eye(3) + 0.45 / 0.1)
    compliance = np.linalg.inv(matrix + ratio * 0.3e6 * np.outer(strength, strength))
    assert material.axial_modulus == pytest.approx(1.0 / compliance[2, 2])
    # The stress of matrix and fibres is linear in Green's strain: so the bar stiffens as St. Venant-Kirchhoff's does.
    assert curve_of_law(material)[:2] == pytest.approx((1.5, 0.5), abs=1e-4)


def test_filaments_have_the_moments_of_their_section():
    axial = np.array([[40.0, 0.01, -0.02], [0.01, 3e-4, 5e-5], [-0.02, 5e-5, 2e-4]])
    points = filaments(axial)
    b = np.column_stack([np.ones(9), points[:, :2]])
    assert np.einsum("f,fi,fj->ij", points[:, 2], b, b) == pytest.approx(axial, rel=1e-9)


@pytest.mark.parametrize(("law", "c"), [("svk", 1.5), ("neo_hookean", -1.03)])
def test_a_rod_that_its_cables_shorten_bends_as_its_law_says(law, c):
    """A slight load across a rod under three even cables, which add no moment: by -4 % of strain svk becomes 12 % softer."""
    model = rod(law, youngs_modulus=0.8e6, element_length=5e-3)
    assert model.curve[0, 0] == pytest.approx(c, abs=0.01)
    strain = -0.04
    force = -model.stiffness[10, 2, 2] * (strain + c * strain**2 + model.curve[0, 1] * strain**3)
    slight, tension = np.array([1e-3, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]) * force / 3.0
    bent, free = equilibrium(model, slight, tension=tension).tip, equilibrium(model, slight).tip
    assert bent[2] / free[2] - 1.0 == pytest.approx(strain, rel=0.01)
    rise = 1.0 + 2.0 * c * strain + 3.0 * model.curve[0, 1] * strain**2
    assert bent[0] / free[0] == pytest.approx((1.0 + strain) ** 2 / rise, rel=0.06)


def test_solution_converges_with_the_second_order_of_the_element_length():
    # Without Poisson's effect: the correction at the clamp belongs to a point and is spread over the first element.
    sizes = (10e-3, 5e-3, 2.5e-3, 0.625e-3)
    tips = [equilibrium(rod(element_length=size, poissons_ratio=0.0), horizontal()).tip for size in sizes]
    errors = [float(np.linalg.norm(tip - tips[-1])) for tip in tips[:-1]]
    assert errors[0] / errors[1] > 3.3
    assert errors[1] / errors[2] > 3.3


def test_exponential_and_logarithm_of_motions_are_inverse():
    random = np.random.default_rng(4)
    for scale in (1e-9, 1e-3, 0.1, 1.0, 1.8):
        xi = scale * random.standard_normal(6)
        xi[3:] *= min(1.0, 3.1 / float(np.linalg.norm(xi[3:])))
        rotation, translation, back = np.empty((3, 3)), np.empty(3), np.empty(6)
        motion_exp(xi, rotation, translation)
        motion_log(rotation, translation, back)
        np.testing.assert_allclose(back, xi, atol=1e-9)


def test_tangent_and_tendon_gradient_agree_with_finite_differences():
    model = rod(element_length=10e-3)
    tension = np.array([0.3, 0.0, 0.0, 0.1, 0.0, 0.2])
    shape = equilibrium(model, horizontal(), tension=tension)
    _, band, gradient, _, _ = forces(model, shape.orientation, shape.position, tension)
    size = 6 * model.elements
    tangent, numeric, lengths = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, model.tendons))
    for i in range(size):
        for j in range(max(0, i - 11), min(size, i + 12)):
            tangent[i, j] = band[i, j - i + 11]
    step = 1e-6
    for k in range(size):
        sides = []
        for sign in (1.0, -1.0):
            orientation, position = shape.orientation.copy(), shape.position.copy()
            xi, turn, shift = np.zeros(6), np.empty((3, 3)), np.empty(3)
            xi[k % 6] = sign * step
            motion_exp(xi, turn, shift)
            advance(orientation[1 + k // 6], position[1 + k // 6], turn, shift, np.empty((3, 3)))
            sides.append(forces(model, orientation, position, tension))
        numeric[:, k] = (sides[0][0] - sides[1][0]) / (2 * step)
        lengths[k] = (sides[0][4] - sides[1][4]) / (2 * step)
    np.testing.assert_allclose(gradient, lengths, atol=1e-6)
    # The rotation of the stress is of first order in the strain: the tangent is accurate to 1 %, the residual exact.
    scale = np.sqrt(np.abs(np.diag(numeric)))
    assert np.max(np.abs(tangent - numeric) / np.outer(scale, scale)) < 0.01


def test_newton_step_solves_with_the_tendons_springs():
    model = rod(element_length=10e-3)
    shape = equilibrium(model, horizontal())
    residual, band, gradient, pull, _ = forces(model, shape.orientation, shape.position, np.full(6, 0.1))
    spring = np.array([2000.0, 0.0, 500.0, 0.0, 1000.0, 0.0])
    size = 6 * model.elements
    matrix = (pull * spring) @ gradient.T
    for i in range(size):
        for j in range(max(0, i - 11), min(size, i + 12)):
            matrix[i, j] += band[i, j - i + 11]
    full = np.concatenate([np.zeros((1, 6)), residual.reshape(-1, 6)])
    increment = newton_step(band, full, gradient, pull, spring, np.empty(len(spring)))
    np.testing.assert_allclose(increment, -np.linalg.solve(matrix, residual), rtol=1e-6, atol=1e-12)


def test_one_tendon_bends_a_weightless_rod_into_a_circle_of_the_right_curvature():
    model = rod()
    tension = np.array([0.0, 0.0, 0.0, 0.0, 0.2, 0.0])  # s2c2, at 180 deg plus the true offset
    shape = equilibrium(model, np.zeros(3), tension=tension)
    strain = np.empty((model.elements, 6))
    strains(shape.orientation, shape.position, model.length, strain)
    radius = float(np.linalg.norm(model.routing.offset[4, 0]))
    bending, axial = model.stiffness[5, 3, 3], model.stiffness[5, 2, 2]
    softer = 1.0 + 2.0 * model.curve[5, 0] * -0.2 / axial  # the law's, shortened by the tendon
    np.testing.assert_allclose(np.hypot(strain[1:, 3], strain[1:, 4]), 0.2 * radius / bending / softer, rtol=0.002)
    np.testing.assert_allclose(strain[1:, 2], 1.0 - 0.2 / axial, atol=1e-4)
    shortened = 0.1 * (0.2 / axial + 0.2 * radius**2 / bending)
    assert shape.displacement[4] == pytest.approx(shortened, rel=0.02)


def test_displacement_and_the_tension_it_makes_give_the_same_shape():
    model = rod()
    wound = np.array([1e-3, -8e-3, -8e-3, 1.5e-3, -8e-3, -8e-3])
    by_displacement = equilibrium(model, horizontal(), displacement=wound)
    by_tension = equilibrium(model, horizontal(), tension=by_displacement.tension)
    np.testing.assert_allclose(by_displacement.tip, by_tension.tip, atol=1e-8)
    assert (by_displacement.tension[[1, 2, 4, 5]] == 0.0).all()


def test_cables_paid_out_have_no_tension_and_no_effect():
    model = rod()
    free, slack = equilibrium(model, horizontal()), equilibrium(model, horizontal(), displacement=np.full(6, -8e-3))
    assert (slack.tension == 0.0).all()
    np.testing.assert_allclose(slack.tip, free.tip, atol=1e-9)


def test_cables_held_at_the_straight_length_hold_the_robot_up():
    model = rod()
    held = equilibrium(model, horizontal(), displacement=np.zeros(6))
    assert held.tip[0] > 0.6 * equilibrium(model, horizontal()).tip[0]
    assert held.tension.max() > 0.1


def test_an_equilibrium_is_found_for_every_gravity_and_displacement():
    model, random = rod(), np.random.default_rng(0)
    for _ in range(200):
        gravity = random.standard_normal(3)
        shape = equilibrium(model, 9.81 * gravity / np.linalg.norm(gravity), displacement=random.uniform(-6e-3, 2.5e-3, 6))
        assert (shape.tension >= 0.0).all() and np.linalg.norm(shape.tip) < 0.101


def test_element_ends_meet_segments_caps_and_cables():
    robot, _ = article()
    model = build_rod(
        true_robot(dataclasses.replace(robot, segments=(robot.segments[0], dataclasses.replace(robot.segments[1], length=80e-3))))
    )
    np.testing.assert_allclose(model.length.sum(), 0.13)
    np.testing.assert_allclose(model.tendon_length, [0.05] * 3 + [0.13] * 3)


def test_values_of_the_wrong_shape_are_refused():
    with pytest.raises(ValueError, match="6 finite values"):
        equilibrium(rod(), horizontal(), displacement=np.zeros(5))
    with pytest.raises(ValueError, match="not by both"):
        equilibrium(rod(), horizontal(), displacement=np.zeros(6), tension=np.zeros(6))
