"""One time step of the moving rod, compiled.

Generalized-alpha on a Lie group (O. Bruls, A. Cardona, "On the use of Lie group time integrators in multibody dynamics", J.
Comput. Nonlinear Dyn. 5, 2010) in the fixed frame, so the inertial forces of a turning base are included:

    M dv/dt - ad_v^T M v + f_int(H) - f_ext = 0,   dH/dt = H v^

The internal forces are those of forces.py with the material of material.py and the tendons' friction of tendon_friction.py. The
share of the tension that arrives in each element is that at the beginning of the step.

The tension T of each tendon is an unknown of Newton's method in addition to the shape, with T = max(0, k s) for the stretch s,
and the geometric stiffness belongs to T, not to k s. With a stiff line k s is far from the tension until the shape is exact, and
its geometric stiffness would mislead every step (mixed iteration; D. Magisano, L. Leonetti, G. Garcea, "How to improve efficiency
and robustness of the Newton method in geometrically non-linear structural problem", Comput. Methods Appl. Mech. Eng. 313, 2017).

While the rod touches a wall (contact.py, contact_force.py), and in the step after, velocity and acceleration are the backward
differences of the pose (J. J. Moreau's time stepping with theta = 1, V. Acary, B. Brogliato, "Numerical Methods for Nonsmooth
Dynamical Systems", 2008, chapter 10): a point that meets a wall stays on it, and no acceleration of an impact is carried on.
"""

import numpy as np
from numba import njit

from gravcomp.virtual.band_solver import newton_step
from gravcomp.virtual.contact import Walls, find_contacts, keep_friction
from gravcomp.virtual.contact_force import Touching, add_contacts, difference, expect, forget_friction, take_over
from gravcomp.virtual.forces import assemble
from gravcomp.virtual.material import step_law, update_history
from gravcomp.virtual.own_contact import (
    OwnTouching,
    add_own_contacts,
    expect_own,
    find_own_contacts,
    own_difference,
    take_own_over,
)
from gravcomp.virtual.possible_state import is_possible
from gravcomp.virtual.rod import strains
from gravcomp.virtual.routing import Routing, tendon_lengths
from gravcomp.virtual.se3 import advance, copy_pose, motion_exp, orthonormalise
from gravcomp.virtual.section_inertia import add_inertia, add_inertia_to_band
from gravcomp.virtual.surface import RodSurface
from gravcomp.virtual.tendon_friction import tension_shares, update_sliding

_SPECTRAL_RADIUS = 0.5  # numerical damping of frequencies that the time step cannot resolve; 1: none
_ALPHA_M = (2 * _SPECTRAL_RADIUS - 1) / (_SPECTRAL_RADIUS + 1)
_ALPHA_F = _SPECTRAL_RADIUS / (_SPECTRAL_RADIUS + 1)
_GAMMA = 0.5 + _ALPHA_F - _ALPHA_M
_BETA = 0.25 * (_GAMMA + 0.5) ** 2
_MOST_ITERATIONS, _MOST_AT_WALLS = 12, 40
_WITH_FRICTION = 25  # iterations at walls; the others start again, and take the step without friction
_LOOSER = 10.0  # than the static equilibrium, in force and moment
_SEARCHES = 4  # for contacts in one step
_NEAR = 0.05  # of the half width of the rod: so near to a wall a point takes part, and farther by twice its way in the step


@njit(cache=True, error_model="numpy")
def time_step(
    dt: float,
    base_orientation: np.ndarray,
    base_position: np.ndarray,
    gravity: np.ndarray,
    load: np.ndarray,
    wound: np.ndarray,
    wound_before: np.ndarray,
    orientation: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    acceleration: np.ndarray,
    velocity_rate: np.ndarray,
    strain: np.ndarray,
    branch_strain: np.ndarray,
    slip_strain: np.ndarray,
    sliding: np.ndarray,
    path: np.ndarray,
    tension: np.ndarray,
    shortened: np.ndarray,
    compliance: np.ndarray,
    length: np.ndarray,
    stiffness: np.ndarray,
    filament: np.ndarray,
    curve: np.ndarray,
    rest_strain: np.ndarray,
    mass: np.ndarray,
    centre: np.ndarray,
    inertia: np.ndarray,
    routing: Routing,
    tendon_rest: np.ndarray,
    spring: np.ndarray,
    branch_ratio: np.ndarray,
    branch_time: np.ndarray,
    damping_time: np.ndarray,
    slip_stiffness: np.ndarray,
    slip_moment: np.ndarray,
    mu: np.ndarray,
    guide_angle: np.ndarray,
    presliding: float,
    tolerances: np.ndarray,
    direction: np.ndarray,
    chord: np.ndarray,
    band: np.ndarray,
    walls: Walls,
    surface: RodSurface,
    rigid: float,
    depth: float,
    held: np.ndarray,
    rim: np.ndarray,
    touching: Touching,
    checked: Touching,
    own: OwnTouching | None,
    own_checked: OwnTouching | None,
) -> tuple[bool, bool]:
    """Advance the rod by dt s in place; return whether the state at the end is possible, and whether the iteration converged.

    The parameters are those of `MovingRod`; load (n + 1, 3) N acts in addition to the weights; wound_before and wound (m,) m are
    the displacements at the beginning and at the end of the step; compliance (m,) receives that of each tendon's path in one
    step, m/N; direction, chord and band are scratch. rigid (N/m) is the stiffness of a point on a rigid wall, depth (m) by how
    much the planes of the contacts may differ from the walls, held (slots, k, 3) N and rim (k, 3) m are those of `find_contacts`;
    checked is scratch. own: pairs of places where the rod touches itself, and own_checked: scratch; None: it does not, and Numba
    compiles nothing for it. If the state is not possible, pose and material keep their values from before the step, and the
    caller sets the rest of the state.
    """
    n, m = length.shape[0], tendon_rest.shape[0]
    linear, constant = step_law(dt, stiffness, rest_strain, strain, branch_strain, branch_ratio, branch_time, damping_time)
    force = np.empty((n + 1, 3))
    for k in range(n + 1):
        for i in range(3):
            force[k, i] = mass[k] * gravity[i] + load[k, i]
    share = tension_shares(strain, length, sliding, routing.start, routing.end, mu, guide_angle)

    start_orientation, start_position = orientation.copy(), position.copy()
    copy_pose(base_orientation, base_position, orientation[0], position[0])
    turn, shift, work = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    obstacles = walls.moving.shape[0] + (0 if own is None else 1)
    reach = 0.0
    if obstacles > 0:
        way = _way(dt, velocity, start_orientation, start_position, orientation, position)
        reach = _NEAR * float(surface.size[n]) + 2.0 * way
    meets = touching.count[0] > 0 and np.any(touching.force[: touching.count[0]] != 0.0)
    if own is not None:
        meets = meets or np.any(own.force[: own.count[0]] != 0.0)
    start_velocity = velocity.copy()
    total_increment = _predict_free(dt, velocity, acceleration, velocity_rate)
    _move(total_increment, start_orientation, start_position, orientation, position, turn, shift, work)
    if obstacles > 0:
        find_contacts(
            walls, surface, length, rigid, reach, orientation, position, start_orientation, start_position, held, rim,
            touching,
        )  # fmt: skip
        meets = meets or np.any(touching.gap[: touching.count[0]] < 0.0)
    if own is not None:  # both places move
        find_own_contacts(surface, length, 2.0 * reach, orientation, position, own)
        meets = meets or np.any(own.gap[: own.count[0]] < 0.0)
    beta, gamma = (1.0 - _ALPHA_M) / (dt * dt * _BETA * (1.0 - _ALPHA_F)), _GAMMA / (dt * _BETA)
    if meets:
        beta, gamma = 1.0 / (dt * dt), 1.0 / dt
        for k in range(1, n + 1):
            for i in range(6):
                velocity[k, i], velocity_rate[k, i], total_increment[k, i] = start_velocity[k, i], 0.0, dt * start_velocity[k, i]
    searches = 1

    path_before = path.copy()
    pulled, law = tension.copy(), np.empty(m)  # T, and k s where the tendon is taut
    active, middle = np.empty(m), band.shape[1] // 2
    gradient, pull = np.empty((6 * n, m)), np.empty((6 * n, m))
    new_strain = np.empty((n, 6))
    converged, slides = False, False
    for iteration in range(_MOST_AT_WALLS if obstacles > 0 else _MOST_ITERATIONS):
        if iteration == _WITH_FRICTION:
            slides = True
            forget_friction(touching)
            _restart(gamma, beta, total_increment, velocity, velocity_rate)
        _move(total_increment, start_orientation, start_position, orientation, position, turn, shift, work)
        strains(orientation, position, length, new_strain)
        tendon_lengths(orientation, position, new_strain, length, routing, direction, chord, path)
        slack = 0.0  # largest stretch of a taut tendon that has become too short
        for c in range(m):
            stretch = wound[c] + np.sum(path[c]) - tendon_rest[c]
            active[c] = spring[c] if stretch > 0.0 or pulled[c] > 0.0 else 0.0
            law[c] = active[c] * stretch
            slack = max(slack, -law[c])
            pulled[c] = max(0.0, pulled[c]) if active[c] > 0.0 else 0.0
            tension[c] = max(0.0, law[c])
        residual = assemble(
            orientation,
            length,
            new_strain,
            rest_strain,
            linear,
            constant,
            filament,
            curve,
            slip_stiffness,
            slip_moment,
            slip_strain,
            routing,
            direction,
            chord,
            path,
            pulled,
            share,
            force,
            centre,
            gradient,
            pull,
            band,
        )
        admissible = add_contacts(touching, orientation, position, _LOOSER * tolerances[0], residual, band)
        all_gradients, all_pulls, all_springs = gradient, pull, active
        if own is not None:
            pairs = own.count[0]
            of_gap, stiff = np.empty((6 * n, pairs)), np.empty(pairs)
            admissible &= add_own_contacts(
                own, rigid, _LOOSER * tolerances[0], orientation, position, residual, of_gap, stiff
            )  # fmt: skip
            all_gradients, all_pulls = np.hstack((gradient, of_gap)), np.hstack((pull, of_gap))
            all_springs = np.concatenate((active, stiff))
        worst = 0.0
        for k in range(1, n + 1):
            for i in range(6):
                for c in range(m):
                    residual[k, i] += pull[6 * (k - 1) + i, c] * (law[c] - pulled[c])
            add_inertia(residual[k], velocity[k], velocity_rate[k], mass[k], centre[k], inertia[k])
            add_inertia_to_band(6 * (k - 1), beta, mass[k], centre[k], inertia[k], middle, band)
            for i in range(6):
                worst = max(worst, abs(residual[k, i]) / tolerances[i // 3])
        if admissible and worst < _LOOSER and slack < _LOOSER * tolerances[0]:
            if obstacles > 0 and searches < _SEARCHES:
                find_contacts(
                    walls, surface, length, rigid, reach, orientation, position, start_orientation, start_position, held, rim,
                    checked,
                )  # fmt: skip
                searches += 1
                if slides:
                    forget_friction(checked)
            agree = obstacles == 0 or searches >= _SEARCHES or difference(touching, checked, orientation, position) < depth
            if own is not None and own_checked is not None and not searches >= _SEARCHES:
                find_own_contacts(surface, length, 2.0 * reach, orientation, position, own_checked)
                agree &= own_difference(own, own_checked, orientation, position) < depth
            if agree:
                converged = True
                break
            take_over(checked, touching)
            if own is not None and own_checked is not None:
                take_own_over(own_checked, own)
            continue
        all_compliances = np.empty(len(all_springs))
        increment = newton_step(band, residual, all_gradients, all_pulls, all_springs, all_compliances)
        compliance[:] = all_compliances[:m]
        expect(touching, orientation, position, increment)
        if own is not None:
            expect_own(own, rigid, all_gradients[:, m:], increment)
        for k in range(1, n + 1):
            for i in range(6):
                change = increment[6 * (k - 1) + i]
                total_increment[k, i] += change
                velocity[k, i] += gamma * change
                velocity_rate[k, i] += beta * change
        if not np.isfinite(increment).all():
            break
        for c in range(m):
            pulled[c] = law[c]
            for k in range(6 * n):
                pulled[c] += active[c] * gradient[k, c] * increment[k]
    for k in range(1, n + 1):
        orthonormalise(orientation[k], work)
        for i in range(6):
            if meets:
                acceleration[k, i] = velocity_rate[k, i]
            else:
                acceleration[k, i] += (1.0 - _ALPHA_F) / (1.0 - _ALPHA_M) * velocity_rate[k, i]

    if not is_possible(orientation, position, new_strain, velocity, length):
        for k in range(n + 1):
            copy_pose(start_orientation[k], start_position[k], orientation[k], position[k])
        return False, False
    if obstacles > 0:
        keep_friction(walls, orientation, touching, held)
    update_history(dt, new_strain, branch_strain, slip_strain, branch_time, slip_stiffness, slip_moment)
    update_sliding(sliding, path_before, path, wound_before, wound, presliding)
    for c in range(m):
        shortened[c] = tendon_rest[c] - np.sum(path[c])
    for e in range(n):
        for i in range(6):
            strain[e, i] = new_strain[e, i]
    return True, converged


@njit(cache=True, error_model="numpy")
def _move(
    increment: np.ndarray,
    start_orientation: np.ndarray,
    start_position: np.ndarray,
    orientation: np.ndarray,
    position: np.ndarray,
    turn: np.ndarray,
    shift: np.ndarray,
    work: np.ndarray,
) -> None:
    """Set the free cross-sections to their start, moved by increment (n + 1, 6); turn, shift and work are scratch."""
    for k in range(1, increment.shape[0]):
        motion_exp(increment[k], turn, shift)
        copy_pose(start_orientation[k], start_position[k], orientation[k], position[k])
        advance(orientation[k], position[k], turn, shift, work)


@njit(cache=True, error_model="numpy")
def _way(
    dt: float,
    velocity: np.ndarray,
    start_orientation: np.ndarray,
    start_position: np.ndarray,
    orientation: np.ndarray,
    position: np.ndarray,
) -> float:
    """Return how far (m) a cross-section moves in dt s: the fastest at its velocity, or the tip that turns with the base."""
    fastest = 0.0
    for k in range(velocity.shape[0]):
        v = velocity[k]
        fastest = max(fastest, v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    moved, n = 0.0, position.shape[0] - 1
    for i in range(3):
        tip = position[0, i] - start_position[n, i]
        for j in range(3):
            along = 0.0
            for k in range(3):
                along += start_orientation[0, k, j] * (start_position[n, k] - start_position[0, k])
            tip += orientation[0, i, j] * along
        moved += tip * tip
    return dt * np.sqrt(fastest) + np.sqrt(moved)


@njit(cache=True, error_model="numpy")
def _restart(
    gamma: float,
    beta: float,
    total_increment: np.ndarray,
    velocity: np.ndarray,
    velocity_rate: np.ndarray,
) -> None:
    """Put the sections back to where they were at the beginning of the step, with the velocities and rates that this implies."""
    for k in range(1, velocity.shape[0]):
        for i in range(6):
            velocity[k, i] -= gamma * total_increment[k, i]
            velocity_rate[k, i] -= beta * total_increment[k, i]
            total_increment[k, i] = 0.0


@njit(cache=True, error_model="numpy")
def _predict_free(dt: float, velocity: np.ndarray, acceleration: np.ndarray, velocity_rate: np.ndarray) -> np.ndarray:
    """Return the first increment (n + 1, 6) of the cross-sections; set velocity, acceleration and rate to match."""
    total_increment = np.zeros(velocity.shape)
    for k in range(1, velocity.shape[0]):
        for i in range(6):
            a = (_ALPHA_F * velocity_rate[k, i] - _ALPHA_M * acceleration[k, i]) / (1.0 - _ALPHA_M)
            total_increment[k, i] = dt * velocity[k, i] + dt * dt * ((0.5 - _BETA) * acceleration[k, i] + _BETA * a)
            velocity[k, i] += dt * ((1.0 - _GAMMA) * acceleration[k, i] + _GAMMA * a)
            acceleration[k, i] = a
            velocity_rate[k, i] = 0.0
    return total_increment
