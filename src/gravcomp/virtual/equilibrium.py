"""Static equilibrium of the rod under gravity and its tendons, after all motion and creep.

It is the minimum of the potential energy of rod, tendons and weight, with the long-term stiffness and without friction. Newton's
iteration runs on the residual of `assemble` of forces.py. Each increment is changed until it is a direction of descent, and
shortened until the energy falls, because cables change between taut and slack and a straight rod under strong cables is unstable:

    U = sum_e L (1/2 (epsilon - epsilon_0)^T K (epsilon - epsilon_0) + E int (c e^3/3 + d e^4/4) dA)
        + sum_c (T_c l_c + k/2 max(0, u + l_c - l_0)^2) - sum_k m_k g (p_k + R_k c_k)
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from gravcomp.virtual.band_solver import newton_step
from gravcomp.virtual.forces import assemble, half_bandwidth
from gravcomp.virtual.rod import RodModel, strains
from gravcomp.virtual.routing import Routing, tendon_lengths
from gravcomp.virtual.se3 import advance, copy_pose, motion_exp

_MOST_ITERATIONS = 200
_MOST_HALVINGS = 12
_MOST_ADDITIONS = 8
_CONTINUATION = 20  # steps from no pull to the whole, where one step fails
_ROUNDING = 1e-4  # of the moment that stands for zero, J
_LARGEST_TURN = 0.3  # rad for each cross-section and iteration; beyond it the linearisation is poor


@dataclass(frozen=True)
class RodShape:
    """A rod at rest, in the frame of its base."""

    orientation: np.ndarray  # (n + 1, 3, 3)
    position: np.ndarray  # (n + 1, 3) m
    tension: np.ndarray  # (m,) N, at the base
    displacement: np.ndarray  # (m,) m, by how much the tendons' paths are shorter than in the unloaded rod
    iterations: int

    @property
    def tip(self) -> np.ndarray:
        """Position (3,) of the tip, m."""
        return self.position[-1]


class NoEquilibrium(RuntimeError):
    """The iteration did not converge; the message holds gravity, displacement and tension."""


def equilibrium(
    model: RodModel,
    gravity: np.ndarray,
    *,
    displacement: np.ndarray | None = None,
    tension: np.ndarray | None = None,
    start: RodShape | None = None,
) -> RodShape:
    """Return the rod at rest under `gravity` (3,) m/s^2 in the frame of its base.

    The tendons are given by displacement (m,) m, wound in at the capstans, or by tension (m,) N; with neither they are released.
    The iteration begins at `start` (a similar shape saves iterations), without it at the unloaded rod. Raises ValueError for
    values of the wrong shape, for values that are not finite and for both of displacement and tension; raises NoEquilibrium where
    the iteration does not converge.
    """
    m = model.tendons
    if displacement is not None and tension is not None:
        raise ValueError("the tendons are given by displacement or by tension, not by both")
    preload = np.zeros(m) if tension is None else _tendon_values(tension, m, "tension")
    stiffness = np.zeros(m) if displacement is None else model.tendon_stiffness
    wound = np.zeros(m) if displacement is None else _tendon_values(displacement, m, "displacement")
    gravity = np.asarray(gravity, float)
    for steps in (1, _CONTINUATION):  # stiff lines wound in at once compress the straight rod far beyond its limit
        shape = start
        for step in range(1, steps + 1):
            shape = _settled(model, gravity, stiffness, wound * step / steps, preload * step / steps, shape)
            if shape is None:
                break
        if shape is not None:
            return shape
    raise NoEquilibrium(f"no equilibrium for gravity {gravity}, displacement {wound} m, tension {preload} N")


def _settled(
    model: RodModel, gravity: np.ndarray, stiffness: np.ndarray, wound: np.ndarray, preload: np.ndarray, start: RodShape | None
) -> RodShape | None:
    """Return the rod at rest, None where the iteration does not converge."""
    first = model.unloaded() if start is None else (start.orientation, start.position)
    orientation, position = first[0].copy(), first[1].copy()
    iterations, tensions, shortened = _settle(
        orientation,
        position,
        model.length,
        model.stiffness,
        model.filament,
        model.curve,
        model.rest_strain,
        model.mass,
        model.centre,
        model.routing,
        model.tendon_length,
        stiffness,
        wound,
        preload,
        gravity,
        model.tolerances,
        *model.scratch(),
        np.empty((6 * model.elements, 2 * half_bandwidth(model.routing.reach) + 1)),
    )
    return RodShape(orientation, position, tensions, shortened, iterations) if iterations < _MOST_ITERATIONS else None


def _tendon_values(values: np.ndarray, m: int, name: str) -> np.ndarray:
    values = np.asarray(values, float)
    if values.shape != (m,) or not np.all(np.isfinite(values)):
        raise ValueError(f"{name} is {values}; {m} finite values are needed, one for each tendon")
    return values


@njit(cache=True, error_model="numpy")
def _settle(
    orientation: np.ndarray,
    position: np.ndarray,
    length: np.ndarray,
    stiffness: np.ndarray,
    filament: np.ndarray,
    curve: np.ndarray,
    rest_strain: np.ndarray,
    mass: np.ndarray,
    centre: np.ndarray,
    routing: Routing,
    tendon_rest: np.ndarray,
    spring: np.ndarray,
    wound: np.ndarray,
    preload: np.ndarray,
    gravity: np.ndarray,
    tolerances: np.ndarray,
    direction: np.ndarray,
    chord: np.ndarray,
    band: np.ndarray,
) -> tuple[int, np.ndarray, np.ndarray]:
    """Move orientation and position to the equilibrium, in place; return iterations, tension (m,), shortened (m,).

    The number of iterations is _MOST_ITERATIONS where no equilibrium was found.
    """
    n, m, width = length.shape[0], tendon_rest.shape[0], band.shape[1]
    strain, path = np.empty((n, 6)), np.empty((m, n))
    gradient, pull = np.empty((6 * n, m)), np.empty((6 * n, m))
    factors = np.empty(band.shape)
    none, no_slip, share = np.zeros(n), np.zeros((n, 2)), np.ones((m, n))
    constant, force = np.zeros((n, 6)), np.empty((n + 1, 3))
    for k in range(n + 1):
        for i in range(3):
            force[k, i] = mass[k] * gravity[i]
    tension, active, shortened, compliance = np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    turn, shift, work = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    strains(orientation, position, length, strain)
    tendon_lengths(orientation, position, strain, length, routing, direction, chord, path)
    law = length, stiffness, filament, curve, rest_strain
    loads = tendon_rest, spring, wound, preload, force, centre
    energy = _energy(orientation, position, strain, path, *law, *loads)
    for iteration in range(_MOST_ITERATIONS):
        for c in range(m):
            shortened[c] = tendon_rest[c] - np.sum(path[c])
            stretch = wound[c] - shortened[c]
            active[c] = spring[c] if stretch > 0.0 else 0.0
            tension[c] = preload[c] + active[c] * stretch
        residual = assemble(
            orientation,
            length,
            strain,
            rest_strain,
            stiffness,
            constant,
            filament,
            curve,
            none,
            none,
            no_slip,
            routing,
            direction,
            chord,
            path,
            tension,
            share,
            force,
            centre,
            gradient,
            pull,
            band,
        )
        if np.max(np.abs(residual[1:, :3])) < tolerances[0] and np.max(np.abs(residual[1:, 3:])) < tolerances[1]:
            return iteration, tension, shortened
        # Where the tangent is not positive definite (a straight rod under strong cables), multiples of its own diagonal are added
        # until the increment descends.
        addition = 0.0
        for _ in range(_MOST_ADDITIONS):
            for k in range(6 * n):
                for i in range(width):
                    factors[k, i] = band[k, i]
                factors[k, width // 2] += addition * band[k, width // 2]
            increment = newton_step(factors, residual, gradient, pull, active, compliance)
            largest, slope = 0.0, 0.0
            for k in range(n):
                for i in range(6):
                    slope += residual[k + 1, i] * increment[6 * k + i]
                    if i >= 3:
                        largest = max(largest, abs(increment[6 * k + i]))
            if slope < 0.0:
                break
            addition = max(1e-4, 10.0 * addition)
        if not largest < 1e6:
            break
        factor = min(1.0, _LARGEST_TURN / (largest + 1e-30))
        start_orientation, start_position, start_energy = orientation.copy(), position.copy(), energy
        for _ in range(_MOST_HALVINGS):
            for k in range(n):
                copy_pose(start_orientation[k + 1], start_position[k + 1], orientation[k + 1], position[k + 1])
                motion_exp(factor * increment[6 * k : 6 * k + 6], turn, shift)
                advance(orientation[k + 1], position[k + 1], turn, shift, work)
            strains(orientation, position, length, strain)
            tendon_lengths(orientation, position, strain, length, routing, direction, chord, path)
            energy = _energy(orientation, position, strain, path, *law, *loads)
            if energy <= start_energy + 1e-4 * factor * slope + _ROUNDING * tolerances[1]:
                break
            factor *= 0.5
    return _MOST_ITERATIONS, tension, shortened


@njit(cache=True, error_model="numpy")
def _energy(
    orientation: np.ndarray,
    position: np.ndarray,
    strain: np.ndarray,
    path: np.ndarray,
    length: np.ndarray,
    stiffness: np.ndarray,
    filament: np.ndarray,
    curve: np.ndarray,
    rest_strain: np.ndarray,
    tendon_rest: np.ndarray,
    spring: np.ndarray,
    wound: np.ndarray,
    preload: np.ndarray,
    force: np.ndarray,
    centre: np.ndarray,
) -> float:
    """Return the potential energy in J."""
    energy = 0.0
    for e in range(length.shape[0]):
        for i in range(6):
            for j in range(6):
                energy += (
                    0.5 * length[e] * stiffness[e, i, j] * (strain[e, i] - rest_strain[e, i]) * (strain[e, j] - rest_strain[e, j])
                )
        z, x, y = strain[e, 2] - rest_strain[e, 2], strain[e, 3] - rest_strain[e, 3], strain[e, 4] - rest_strain[e, 4]
        for f in range(filament.shape[1]):
            own = z + x * filament[e, f, 0] + y * filament[e, f, 1]
            bent = max(own, curve[e, 2])
            beyond = own - bent
            density = bent**3 * (curve[e, 0] / 3.0 + curve[e, 1] * bent / 4.0)
            density += beyond * bent**2 * (curve[e, 0] + curve[e, 1] * bent)
            density += 0.5 * beyond**2 * bent * (2.0 * curve[e, 0] + 3.0 * curve[e, 1] * bent)
            energy += length[e] * filament[e, f, 2] * density
    for c in range(path.shape[0]):
        total = np.sum(path[c])
        stretch = max(0.0, wound[c] + total - tendon_rest[c])
        energy += preload[c] * total + 0.5 * spring[c] * stretch * stretch
    for k in range(position.shape[0]):
        for i in range(3):
            place = position[k, i]
            for j in range(3):
                place += orientation[k, i, j] * centre[k, j]
            energy -= force[k, i] * place
    return energy
