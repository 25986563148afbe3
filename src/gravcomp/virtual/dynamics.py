"""The rod in motion: its base is carried about, its tendons are wound in, gravity pulls, the material creeps.

Generalized-alpha on a Lie group (O. Bruls, A. Cardona, "On the use of Lie group time integrators in multibody dynamics", J.
Comput. Nonlinear Dyn. 5, 2010) in the fixed frame, so that a turning base brings its inertial forces along:

    M dv/dt - ad_v^T M v + f_int(H) - f_ext = 0,   dH/dt = H v^

Material: a generalised Maxwell solid on the strains, which are objective, with a frictional branch for the hysteresis that
does not depend on the rate:

    sigma = K (epsilon - e_z) + sum_j g_j K (epsilon - a_j) + eta K d epsilon/dt + slip,    d a_j/dt = (epsilon - a_j) / tau_j
    slip: a spring on the two curvatures, in series with a slider that yields at the moment m_y

Tendons: T_0 = k max(0, u + l - l_0) as in `rod`; the share that arrives in an element follows the capstan equation with a sliding
state z in [-1, 1] (P. R. Dahl's presliding, over the distance delta):

    share_e = exp(-mu (z_0 Theta_guide + sum_{j <= e} z_j Theta_j)),    dz/ds = (1 - z sign(ds)) / delta,  s: sliding toward
    the base
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from gravcomp.virtual.equilibrium import RodShape, advance
from gravcomp.virtual.rod import RodModel, assemble, newton_step, strains, tendon_lengths
from gravcomp.virtual.se3 import motion_exp, rotation_to_quaternion

_SPECTRAL_RADIUS = 0.5  # damping of what the time step cannot resolve; 1 damps nothing
_ALPHA_M = (2 * _SPECTRAL_RADIUS - 1) / (_SPECTRAL_RADIUS + 1)
_ALPHA_F = _SPECTRAL_RADIUS / (_SPECTRAL_RADIUS + 1)
_GAMMA = 0.5 + _ALPHA_F - _ALPHA_M
_BETA = 0.25 * (_GAMMA + 0.5) ** 2
_MOST_ITERATIONS = 8
_LARGEST_TURN = 1.5  # rad in one element
_LARGEST_VELOCITY = 2e3  # m/s and rad/s
_FORCE_TOLERANCE = 1e-7  # N and N m; one cross-section weighs 3e-3 N


@dataclass(frozen=True)
class RodMaterial:
    """What the rod's material does over time; n elements, k Maxwell branches."""

    branch_ratio: np.ndarray  # (k,) stiffness of each branch over the long-term stiffness
    branch_time: np.ndarray  # (k,) s
    damping_time: float  # s, eta
    slip_stiffness: np.ndarray  # (n,) N m^2
    slip_moment: np.ndarray  # (n,) N m


@dataclass(frozen=True)
class TendonFriction:
    """How tendons rub."""

    coefficient: float  # mu
    guide_angle: float  # rad, Theta_guide: turns between capstan and robot
    presliding: float  # m, delta


class MovingRod:
    """The state of the rod and its step in time."""

    def __init__(self, model: RodModel, material: RodMaterial, friction: TendonFriction):
        self.model, self.material, self.friction = model, material, friction
        n, m, k = model.elements, model.tendons, len(material.branch_time)
        self.orientation, self.position = model.straight()
        self.velocity = np.zeros((n + 1, 6))
        self._acceleration, self._velocity_rate = np.zeros((n + 1, 6)), np.zeros((n + 1, 6))
        self._branch_strain = np.zeros((k, n, 6))
        self._branch_strain[:, :, 2] = 1.0
        self._slip_strain = np.zeros((n, 2))
        self.strain = np.zeros((n, 6))
        self._sliding = np.zeros((m, n + 1))  # the guide first
        self._path = np.zeros((m, n))
        self._wound = np.zeros(m)
        self.tension = np.zeros(m)  # N, at the capstan
        self.shortened = np.zeros(m)  # m, by how much the tendons' paths are shorter than in the straight rod
        self.tendon_stiffness = model.tendon_stiffness.copy()  # N/m; 0: the tendon is broken
        self._measure()

    def along(self, station: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (k, 3) and orientations (k, 4), x y z w, in the base's frame at the stations (k,), along the helices of
        the elements.
        """
        position, orientation = np.empty((len(station), 3)), np.empty((len(station), 4))
        _along(
            station, self.model.station, self.orientation, self.position, self.strain, self.model.length, position, orientation
        )
        return position, orientation

    @property
    def tension_share(self) -> np.ndarray:
        """(m, n): share of the tension at the capstan that arrives in each element."""
        friction = self.friction
        return _shares(
            self.strain,
            self.model.length,
            self._sliding,
            self.model.tendon_start,
            self.model.tendon_end,
            friction.coefficient,
            friction.guide_angle,
        )

    def rest(self, shape: RodShape, base_orientation: np.ndarray, base_position: np.ndarray) -> None:
        """Put the rod at rest into `shape`, fully relaxed, its base at the given pose."""
        self.orientation = base_orientation @ shape.orientation
        self.position = base_position + shape.position @ base_orientation.T
        self.velocity[:] = 0.0
        self._acceleration[:] = 0.0
        self._velocity_rate[:] = 0.0
        self._measure()
        self._branch_strain[:] = self.strain
        self._slip_strain[:] = self.strain[:, 3:5]
        self.tension = shape.tension.copy()

    def step(
        self, dt: float, base_orientation: np.ndarray, base_position: np.ndarray, gravity: np.ndarray, wound: np.ndarray
    ) -> bool:
        """Advance by `dt` s to the base pose given, with gravity (3,) in the fixed frame and the displacement wound in (m,) at
        the end.

        Returns whether the iteration converged. After a step that cannot be resolved the rod is carried along rigidly and at
        rest.
        """
        model, material, friction = self.model, self.material, self.friction
        possible, iterations = _step(
            dt,
            base_orientation,
            base_position,
            gravity,
            wound,
            self._wound,
            self.orientation,
            self.position,
            self.velocity,
            self._acceleration,
            self._velocity_rate,
            self.strain,
            self._branch_strain,
            self._slip_strain,
            self._sliding,
            self._path,
            self.tension,
            self.shortened,
            model.length,
            model.stiffness,
            model.mass,
            model.inertia,
            model.tendon_offset,
            model.tendon_start,
            model.tendon_end,
            model.tendon_length,
            self.tendon_stiffness,
            material.branch_ratio,
            material.branch_time,
            material.damping_time,
            material.slip_stiffness,
            material.slip_moment,
            friction.coefficient,
            friction.guide_angle,
            friction.presliding,
        )
        self._wound[:] = wound
        if not possible:
            self._rest_as_it_was(base_orientation, base_position)
            return False
        return iterations < _MOST_ITERATIONS

    def carry(self, base_orientation: np.ndarray, base_position: np.ndarray) -> None:
        """Put the base elsewhere and the rod with it, as one rigid body: shape, strains and body velocities stay as they are."""
        turn = base_orientation @ self.orientation[0].T
        self.orientation = turn @ self.orientation
        self.orientation[0] = base_orientation  # otherwise the rounding in it doubles from time to time
        self.position = base_position + (self.position - self.position[0]) @ turn.T

    def _measure(self) -> None:
        model = self.model
        strains(self.orientation, self.position, model.length, self.strain)
        direction = np.zeros((model.tendons, model.elements, 3))
        tendon_lengths(
            self.strain, model.length, model.tendon_offset, model.tendon_start, model.tendon_end, direction, self._path
        )
        self.shortened[:] = model.tendon_length - self._path.sum(axis=1)

    def _rest_as_it_was(self, base_orientation: np.ndarray, base_position: np.ndarray) -> None:
        self.carry(base_orientation, base_position)
        for rates in (self.velocity, self._acceleration, self._velocity_rate):
            rates[:] = 0.0
        self._sliding[:] = 0.0
        self.tension[:] = 0.0
        self._measure()


@njit(cache=True, error_model="numpy")
def _step(
    dt,
    base_orientation,
    base_position,
    gravity,
    wound,
    wound_before,
    orientation,
    position,
    velocity,
    acceleration,
    velocity_rate,
    strain,
    branch_strain,
    slip_strain,
    sliding,
    path,
    tension,
    shortened,
    length,
    stiffness,
    mass,
    inertia,
    tendon_offset,
    tendon_start,
    tendon_end,
    tendon_rest,
    spring,
    branch_ratio,
    branch_time,
    damping_time,
    slip_stiffness,
    slip_moment,
    mu,
    guide_angle,
    presliding,
):
    """Whether the state at the end is possible, and how many iterations it took; pose and material are those of before if it is not."""
    n, m, branches = length.shape[0], tendon_end.shape[0], branch_time.shape[0]
    beta = (1.0 - _ALPHA_M) / (dt * dt * _BETA * (1.0 - _ALPHA_F))
    gamma = _GAMMA / (dt * _BETA)
    linear, constant, force = np.empty((n, 6)), np.zeros((n, 6)), np.empty((n + 1, 3))
    for e in range(n):
        for i in range(6):
            rest = 1.0 if i == 2 else 0.0
            total = stiffness[e, i]
            for j in range(branches):
                part = branch_ratio[j] * stiffness[e, i] / (1.0 + dt / branch_time[j])
                total += part
                constant[e, i] += part * (rest - branch_strain[j, e, i])
            part = damping_time * stiffness[e, i] / dt
            constant[e, i] += part * (rest - strain[e, i])
            linear[e, i] = total + part
    for k in range(n + 1):
        for i in range(3):
            force[k, i] = mass[k] * gravity[i]
    share = _shares(strain, length, sliding, tendon_start, tendon_end, mu, guide_angle)

    total_increment = np.zeros((n + 1, 6))
    for k in range(1, n + 1):
        for i in range(6):
            a = (_ALPHA_F * velocity_rate[k, i] - _ALPHA_M * acceleration[k, i]) / (1.0 - _ALPHA_M)
            total_increment[k, i] = dt * velocity[k, i] + dt * dt * ((0.5 - _BETA) * acceleration[k, i] + _BETA * a)
            velocity[k, i] += dt * ((1.0 - _GAMMA) * acceleration[k, i] + _GAMMA * a)
            acceleration[k, i] = a
            velocity_rate[k, i] = 0.0
    start_orientation, start_position = orientation.copy(), position.copy()
    start_branch_strain, start_slip_strain = branch_strain.copy(), slip_strain.copy()
    orientation[0] = base_orientation
    position[0] = base_position

    path_before = path.copy()
    direction, active, work = np.zeros((m, n, 3)), np.empty(m), np.empty((3, 3))
    gradient, pull, band = np.empty((6 * n, m)), np.empty((6 * n, m)), np.empty((6 * n, 23))
    new_strain = np.empty((n, 6))
    turn, shift = np.empty((3, 3)), np.empty(3)
    iterations = _MOST_ITERATIONS
    for iteration in range(_MOST_ITERATIONS):
        for k in range(1, n + 1):
            motion_exp(total_increment[k], turn, shift)
            orientation[k] = start_orientation[k]
            position[k] = start_position[k]
            advance(orientation[k], position[k], turn, shift, work)
        strains(orientation, position, length, new_strain)
        tendon_lengths(new_strain, length, tendon_offset, tendon_start, tendon_end, direction, path)
        for c in range(m):
            stretch = wound[c] + np.sum(path[c]) - tendon_rest[c]
            active[c] = spring[c] if stretch > 0.0 else 0.0
            tension[c] = active[c] * stretch
        residual = assemble(
            orientation,
            length,
            new_strain,
            linear,
            constant,
            slip_stiffness,
            slip_moment,
            slip_strain,
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
        worst = 0.0
        for k in range(1, n + 1):
            _add_inertia(residual[k], velocity[k], velocity_rate[k], mass[k], inertia[k])
            for i in range(6):
                worst = max(worst, abs(residual[k, i]))
                band[6 * (k - 1) + i, 11] += beta * (mass[k] if i < 3 else inertia[k, i - 3])
        if worst < _FORCE_TOLERANCE:
            iterations = iteration
            break
        increment = newton_step(band, residual, gradient, pull, active)
        for k in range(1, n + 1):
            for i in range(6):
                change = increment[6 * (k - 1) + i]
                total_increment[k, i] += change
                velocity[k, i] += gamma * change
                velocity_rate[k, i] += beta * change
        if not np.isfinite(increment).all():
            break
    for k in range(1, n + 1):
        _orthonormalise(orientation[k], work)
        for i in range(6):
            acceleration[k, i] += (1.0 - _ALPHA_F) / (1.0 - _ALPHA_M) * velocity_rate[k, i]

    for e in range(n):
        for j in range(branches):
            r = dt / branch_time[j]
            for i in range(6):
                branch_strain[j, e, i] = (branch_strain[j, e, i] + r * new_strain[e, i]) / (1.0 + r)
        k0 = slip_stiffness[e] * (new_strain[e, 3] - slip_strain[e, 0])
        k1 = slip_stiffness[e] * (new_strain[e, 4] - slip_strain[e, 1])
        trial = math.sqrt(k0 * k0 + k1 * k1)
        if trial > slip_moment[e]:
            excess = (1.0 - slip_moment[e] / trial) / slip_stiffness[e]
            slip_strain[e, 0] += excess * k0
            slip_strain[e, 1] += excess * k1
    for c in range(m):
        beyond = 0.0
        for e in range(n - 1, -1, -1):
            beyond += path_before[c, e] - path[c, e]
            sliding[c, e + 1] = _slide(sliding[c, e + 1], beyond, presliding)
        sliding[c, 0] = _slide(sliding[c, 0], wound[c] - wound_before[c], presliding)
        shortened[c] = tendon_rest[c] - np.sum(path[c])
    strain[:] = new_strain
    possible = _is_possible(orientation, position, strain, velocity, length)
    if not possible:
        orientation[:], position[:] = start_orientation, start_position
        branch_strain[:], slip_strain[:] = start_branch_strain, start_slip_strain
    return possible, iterations


@njit(cache=True, error_model="numpy")
def _is_possible(orientation, position, strain, velocity, length):
    """Written so that NaN is not possible."""
    reach = 2.0 * np.sum(length)
    possible = True
    for k in range(orientation.shape[0]):
        for i in range(3):
            possible = possible and abs(position[k, i] - position[0, i]) < reach
            for j in range(3):
                possible = possible and abs(orientation[k, i, j]) < 1.0 + 1e-6
        for i in range(6):
            possible = possible and abs(velocity[k, i]) < _LARGEST_VELOCITY
    for e in range(length.shape[0]):
        for i in range(3, 6):
            possible = possible and abs(strain[e, i]) * length[e] < _LARGEST_TURN
    return possible


@njit(cache=True, error_model="numpy")
def _along(station, node_station, orientation, position, strain, length, out_position, out_orientation):
    turn, shift, work, relative = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    here, place = np.empty((3, 3)), np.empty(3)
    base, origin = orientation[0], position[0]
    for s in range(station.shape[0]):
        e = min(max(np.searchsorted(node_station, station[s], side="right") - 1, 0), length.shape[0] - 1)
        part = (station[s] - node_station[e]) / (node_station[e + 1] - node_station[e])
        motion_exp(part * length[e] * strain[e], turn, shift)
        here[:], place[:] = orientation[e], position[e]
        advance(here, place, turn, shift, work)
        for i in range(3):
            out_position[s, i] = 0.0
            for k in range(3):
                out_position[s, i] += base[k, i] * (place[k] - origin[k])
            for j in range(3):
                relative[i, j] = base[0, i] * here[0, j] + base[1, i] * here[1, j] + base[2, i] * here[2, j]
        rotation_to_quaternion(relative, out_orientation[s])


@njit(cache=True, error_model="numpy")
def _orthonormalise(rotation, work):
    """One step of Newton's iteration for the nearest rotation, R (3 - R^T R) / 2: keeps rounding from adding up over hours."""
    for i in range(3):
        for j in range(3):
            product = 0.0
            for k in range(3):
                product += rotation[k, i] * rotation[k, j]
            work[i, j] = (1.5 if i == j else 0.0) - 0.5 * product
    for i in range(3):
        a, b, c = rotation[i, 0], rotation[i, 1], rotation[i, 2]
        for j in range(3):
            rotation[i, j] = a * work[0, j] + b * work[1, j] + c * work[2, j]


@njit(cache=True, error_model="numpy")
def _shares(strain, length, sliding, tendon_start, tendon_end, mu, guide_angle):
    """(m, n): share of the tension at the capstan that arrives in each element."""
    n, m = length.shape[0], tendon_end.shape[0]
    share = np.ones((m, n))
    for c in range(m):
        exponent = sliding[c, 0] * guide_angle
        for e in range(tendon_start[c], tendon_end[c]):
            half = 0.5 * length[e] * math.sqrt(strain[e, 3] ** 2 + strain[e, 4] ** 2) * sliding[c, e + 1]
            exponent += half
            share[c, e] = math.exp(-mu * exponent)
            exponent += half
    return share


@njit(cache=True, error_model="numpy")
def _slide(z, distance, presliding):
    """The sliding state after sliding by `distance` toward the base: Dahl's equation, integrated exactly."""
    if distance >= 0.0:
        return 1.0 - (1.0 - z) * math.exp(-distance / presliding)
    return -1.0 + (1.0 + z) * math.exp(distance / presliding)


@njit(cache=True, error_model="numpy")
def _add_inertia(residual, velocity, rate, mass, inertia):
    """residual (6,) += M rate - ad_v^T M v of one cross-section."""
    v0, v1, v2, w0, w1, w2 = velocity[0], velocity[1], velocity[2], velocity[3], velocity[4], velocity[5]
    residual[0] += mass * (rate[0] + w1 * v2 - w2 * v1)
    residual[1] += mass * (rate[1] + w2 * v0 - w0 * v2)
    residual[2] += mass * (rate[2] + w0 * v1 - w1 * v0)
    residual[3] += inertia[0] * rate[3] + (inertia[2] - inertia[1]) * w1 * w2
    residual[4] += inertia[1] * rate[4] + (inertia[0] - inertia[2]) * w2 * w0
    residual[5] += inertia[2] * rate[5] + (inertia[1] - inertia[0]) * w0 * w1
