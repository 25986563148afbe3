"""Static equilibrium of the rod: where it comes to rest under gravity and its tendons, long after the last motion.

The minimum of the potential energy of rod, tendons and weight, found by Newton's iteration on the residual of `rod.assemble`
with the long-term stiffness and without friction. Each step is turned until it leads downhill and shortened until the energy
falls: cables go taut and slack by turns, and a straight rod under strong cables is unstable:

    U = sum_e L/2 (epsilon - e_z)^T K (epsilon - e_z) + sum_c (T_c l_c + k/2 max(0, u + l_c - l_0)^2) - sum_k m_k g p_k
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from gravcomp.virtual.rod import RodModel, assemble, newton_step, strains, tendon_lengths
from gravcomp.virtual.se3 import motion_exp

_MOST_ITERATIONS = 200
_MOST_HALVINGS = 12
_MOST_ADDITIONS = 8
_ROUNDING = 1e-13  # J; the energies are some 1e-3 J
_LARGEST_TURN = 0.3  # rad a cross-section and iteration; beyond it the linearisation says little
_FORCE_TOLERANCE = 1e-8  # N and N m; the robot weighs 0.06 N


@dataclass(frozen=True)
class RodShape:
    """A rod at rest, in the frame of its base."""

    orientation: np.ndarray  # (n + 1, 3, 3)
    position: np.ndarray  # (n + 1, 3) m
    tension: np.ndarray  # (m,) N, at the base
    displacement: np.ndarray  # (m,) m, by which the tendons' paths have become shorter than in the straight rod
    iterations: int

    @property
    def tip(self) -> np.ndarray:
        """(3,) m."""
        return self.position[-1]


class NoEquilibrium(RuntimeError):
    """The iteration did not come to rest."""


def equilibrium(
    model: RodModel,
    gravity: np.ndarray,
    *,
    displacement: np.ndarray | None = None,
    tension: np.ndarray | None = None,
    start: RodShape | None = None,
) -> RodShape:
    """The rod at rest under `gravity` (3,) m/s^2 in the base's frame.

    displacement (m,) m: wound in at the capstans, tendons that only pull and that stretch; or tension (m,) N, given; or
    neither: released. `start` is the shape to begin from (a neighbouring one saves iterations). Raises NoEquilibrium.
    """
    m = model.tendons
    if displacement is not None and tension is not None:
        raise ValueError("the tendons are given by displacement or by tension, not by both")
    preload = np.zeros(m) if tension is None else _tendon_values(tension, m, "tension")
    stiffness = np.zeros(m) if displacement is None else model.tendon_stiffness
    wound = np.zeros(m) if displacement is None else _tendon_values(displacement, m, "displacement")
    gravity = np.asarray(gravity, float)
    first = model.straight() if start is None else (start.orientation, start.position)
    orientation, position = first[0].copy(), first[1].copy()
    iterations, tensions, shortened = _settle(
        orientation,
        position,
        model.length,
        model.stiffness,
        model.mass,
        model.tendon_offset,
        model.tendon_start,
        model.tendon_end,
        model.tendon_length,
        stiffness,
        wound,
        preload,
        gravity,
    )
    if iterations < _MOST_ITERATIONS:
        return RodShape(orientation, position, tensions, shortened, iterations)
    raise NoEquilibrium(f"no equilibrium for gravity {gravity}, displacement {wound} m, tension {preload} N")


def _tendon_values(values: np.ndarray, m: int, name: str) -> np.ndarray:
    values = np.asarray(values, float)
    if values.shape != (m,) or not np.all(np.isfinite(values)):
        raise ValueError(f"{name} is {values}; {m} finite values are needed, one a tendon")
    return values


@njit(cache=True, error_model="numpy")
def _settle(
    orientation,
    position,
    length,
    stiffness,
    mass,
    tendon_offset,
    tendon_start,
    tendon_end,
    tendon_rest,
    spring,
    wound,
    preload,
    gravity,
):
    n, m = length.shape[0], tendon_end.shape[0]
    strain, path, direction = np.empty((n, 6)), np.empty((m, n)), np.zeros((m, n, 3))
    gradient, pull, band = np.empty((6 * n, m)), np.empty((6 * n, m)), np.empty((6 * n, 23))
    factors = np.empty((6 * n, 23))
    none, no_slip, share = np.zeros(n), np.zeros((n, 2)), np.ones((m, n))
    constant, force = np.zeros((n, 6)), np.empty((n + 1, 3))
    for k in range(n + 1):
        for i in range(3):
            force[k, i] = mass[k] * gravity[i]
    tension, active, shortened = np.empty(m), np.empty(m), np.empty(m)
    turn, shift, work = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    strains(orientation, position, length, strain)
    tendon_lengths(strain, length, tendon_offset, tendon_start, tendon_end, direction, path)
    energy = _energy(position, strain, length, stiffness, path, tendon_rest, spring, wound, preload, force)
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
            stiffness,
            constant,
            none,
            none,
            no_slip,
            tendon_offset,
            tendon_start,
            tendon_end,
            direction,
            path,
            tension,
            share,
            force,
            gradient,
            pull,
            band,
        )
        if np.max(np.abs(residual[1:])) < _FORCE_TOLERANCE:
            return iteration, tension, shortened
        # Where the tangent is not positive definite (a straight rod under strong cables), its own diagonal is added until the
        # step descends.
        addition = 0.0
        for _ in range(_MOST_ADDITIONS):
            factors[:] = band
            for k in range(6 * n):
                factors[k, 11] += addition * band[k, 11]
            increment = newton_step(factors, residual, gradient, pull, active)
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
                orientation[k + 1] = start_orientation[k + 1]
                position[k + 1] = start_position[k + 1]
                motion_exp(factor * increment[6 * k : 6 * k + 6], turn, shift)
                advance(orientation[k + 1], position[k + 1], turn, shift, work)
            strains(orientation, position, length, strain)
            tendon_lengths(strain, length, tendon_offset, tendon_start, tendon_end, direction, path)
            energy = _energy(position, strain, length, stiffness, path, tendon_rest, spring, wound, preload, force)
            if energy <= start_energy + 1e-4 * factor * slope + _ROUNDING:
                break
            factor *= 0.5
    return _MOST_ITERATIONS, tension, shortened


@njit(cache=True, error_model="numpy")
def _energy(position, strain, length, stiffness, path, tendon_rest, spring, wound, preload, force):
    energy = 0.0
    for e in range(length.shape[0]):
        for i in range(6):
            deviation = strain[e, i] - (1.0 if i == 2 else 0.0)
            energy += 0.5 * length[e] * stiffness[e, i] * deviation * deviation
    for c in range(path.shape[0]):
        total = np.sum(path[c])
        stretch = max(0.0, wound[c] + total - tendon_rest[c])
        energy += preload[c] * total + 0.5 * spring[c] * stretch * stretch
    for k in range(position.shape[0]):
        for i in range(3):
            energy -= force[k, i] * position[k, i]
    return energy


@njit(cache=True, error_model="numpy")
def advance(orientation, position, turn, shift, work):
    """The pose (orientation (3, 3), position (3,)) moved in its own frame by (turn, shift), in place."""
    for i in range(3):
        position[i] += orientation[i, 0] * shift[0] + orientation[i, 1] * shift[1] + orientation[i, 2] * shift[2]
        for j in range(3):
            work[i, j] = orientation[i, 0] * turn[0, j] + orientation[i, 1] * turn[1, j] + orientation[i, 2] * turn[2, j]
    for i in range(3):
        for j in range(3):
            orientation[i, j] = work[i, j]
