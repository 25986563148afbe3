"""Motion in reduced coordinates: the full model's scheme (`simulation.dynamics`) in r unknowns.

    M_r = Phi^T M Phi,     g(q) = J^T (eps + beta d eps / dt + rho eta) - Phi^T f_weight - H^T lambda,

integrated by generalized-alpha. The strains eps(q) of the reduced elasticity are objective, and so is Kelvin-Voigt's damping
with their second backward difference and the creep of `simulation.viscosity` (rho, held strain eta); beta, rho and T are the
same in the whole robot. Each Newton step has its own factor, which is cheap here, and the correction that this factor still
gives after the step decides whether another one is needed. A step is one compiled function, as in `tracking`.
"""

import dataclasses

import numpy as np
from numba import njit

from gravcomp.cables.slack import pivoted
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.generalized_alpha import DynamicsOptions, GeneralizedAlpha
from gravcomp.full_model.viscosity import branch
from gravcomp.reduction.body import Point, body_of, cable_arrays, point_at
from gravcomp.reduction.cholesky import factorise, solve
from gravcomp.reduction.reduced_cables import ReducedTendons, add_stiffness, lacking
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.reduction.strain_polynomials import tangent
from gravcomp.rounding import REORDERED

_MOST_ITERATIONS = 16


@dataclasses.dataclass(frozen=True)
class ReducedMotion:
    """A state of motion: q, velocity, acceleration (r,), tension (m,), the model at that point, the forces g (r,), the strains (k,)
    one step before and those held by the branch that creeps, that step in s, the norm of the forces out of balance in N, and
    whether the step converged.
    """

    q: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    tension: np.ndarray
    point: Point
    force: np.ndarray
    strain_before: np.ndarray
    held: np.ndarray
    step: float = 0.0
    residual: float = 0.0
    converged: bool = True

    @property
    def tendons(self) -> ReducedTendons:
        return self.point.tendons


class ReducedDynamicSolver:
    """Integrates the motion of a reduced model; it owns the current state."""

    def __init__(
        self,
        model: ReducedModel,
        mass: np.ndarray,
        damping_time: float,
        length: float,
        options: DynamicsOptions = DynamicsOptions(),
        tolerance: float = 1e-6,
        creep: tuple[float, float] = (0.0, 1.0),
    ):
        """mass (r, r) in the coordinates; damping_time (s) of Kelvin-Voigt's law; length (m) of the robot; tolerance:
        correction of the tip's displacement, as a fraction of the length, that ends a step; creep: rho and T in s, as in
        `simulation.viscosity`.
        """
        self.model, self.options = model, options
        self._mass = mass
        self._damping_time, self._creep_ratio = (damping_time, creep[0]) if options.damping == "kelvin_voigt" else (0.0, 0.0)
        self._creep_time = creep[1]
        self._tolerance = tolerance * length
        self._body = body_of(model)
        self.place(np.zeros(model.size), np.zeros(len(model.cables.rest_length)), np.zeros(3))

    def place(self, q: np.ndarray, tension: np.ndarray, gravity: np.ndarray) -> None:
        """Start at rest at q (r,) under the tensions (m,) and gravity (3,), with the acceleration that follows."""
        point = point_at(self._body, q)
        force = point.jacobian @ point.strain - self.model.weight @ gravity - tension @ point.tendons.jacobian
        acceleration = np.linalg.solve(self._mass, -force)
        self.state = ReducedMotion(
            q, np.zeros_like(q), acceleration, tension, point, force, point.strain, np.zeros_like(point.strain)
        )

    def take_over(self, q: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, tension: np.ndarray) -> None:
        """Take over a motion that another model found: q, velocity and acceleration (r,), tension (m,).

        The forces are taken to be those that the acceleration needs; this model's own would jar its highest frequencies.
        """
        force, drag = -self._mass @ acceleration, self._rayleigh(q)
        if drag is not None:
            force -= drag @ velocity
        point = point_at(self._body, q)
        self.state = ReducedMotion(q, velocity, acceleration, tension, point, force, point.strain, np.zeros_like(point.strain))

    def step(self, gravity: np.ndarray, cables: CableInput, h: float) -> ReducedMotion:
        """One step of h seconds; `converged` is False when Newton's method did not settle, the state is then the old one."""
        model, last = self.model, self.state
        scheme = GeneralizedAlpha.of(h, self.options.spectral_radius)
        now, before = 1.0 - scheme.alpha_f, scheme.alpha_f
        rate, history = _backward_difference(last, h)
        decay, gain = branch(h, self._creep_time)
        scale = 1.0 + self._damping_time * rate + self._creep_ratio * gain
        strain = last.point.strain
        offset = self._damping_time * history + self._creep_ratio * (decay * last.held - gain * strain)
        drag = self._rayleigh(last.q)
        velocity_0, acceleration_0 = scheme.predict(last.velocity, last.acceleration)
        # Forces of the step before, inertia's included, in the balance of this one.
        rest = self._mass @ ((1.0 - scheme.alpha_m) * acceleration_0 + scheme.alpha_m * last.acceleration) + before * last.force
        rest += drag @ (now * velocity_0 + before * last.velocity)
        inertia = ((1.0 - scheme.alpha_m) * scheme.acceleration_rate) * self._mass + (now * scheme.velocity_rate) * drag
        converged, q, tension, point, force, residual = _stepped(
            self._body, last.point, last.q, last.tension, rest, inertia, model.weight @ gravity,
            *cable_arrays(cables, last.tension.size), now, scale, offset, self._tolerance,
        )  # fmt: skip
        if not converged:
            self.state = dataclasses.replace(last, converged=False)
            return self.state
        moved = q - last.q
        self.state = ReducedMotion(
            q=q,
            velocity=velocity_0 + scheme.velocity_rate * moved,
            acceleration=acceleration_0 + scheme.acceleration_rate * moved,
            tension=tension,
            point=point,
            force=force,
            strain_before=strain,
            held=decay * last.held + gain * (point.strain - strain),
            step=h,
            residual=residual,
        )
        return self.state

    def _rayleigh(self, q: np.ndarray) -> np.ndarray:
        """alpha M + beta K(q) (r, r); zeros where the material damps."""
        options = self.options
        if options.damping != "rayleigh":
            return np.zeros_like(self._mass)
        stiffness = np.tril(self.model.elasticity.evaluate(q)[1])
        stiffness += np.tril(stiffness, -1).T
        return options.rayleigh_mass * self._mass + options.rayleigh_stiffness * stiffness


@njit(cache=True, fastmath=REORDERED)
def _stepped(body, point, q, tension, rest, inertia, weight, wound, given, now, scale, offset, tolerance):
    """Whether the step converged, and at its end q, tension, point, force g and the norm of the forces out of balance in N.

    The balance is rest (r,) + inertia (r, r) (q - q_n) + now g(q); wound, given: of `cable_arrays`; scale and offset (k,): the
    stress is scale eps + offset; tolerance: m of the tip.
    """
    m, r, start, cables = len(tension), len(q), q, body.cables
    compliance, answer, of_tip = np.zeros((m, m)), np.zeros((m, r)), np.zeros((3, r))
    for iteration in range(_MOST_ITERATIONS + 1):
        stress = scale * point.strain + offset
        force = point.jacobian @ stress - weight - tension @ point.tendons.jacobian
        out = rest + inertia @ (q - start) + now * force
        if iteration > 0:
            pull = np.zeros(m) if len(given) else lacking(cables, point.tendons, tension, compliance, wound)
            left = of_tip @ out - body.tip @ (pull @ answer)
            if (left**2).sum() < tolerance**2:
                return True, q, tension, point, force, np.sqrt(out @ (body.force_norm @ out))
        elastic = now * tangent(point.jacobian, body.quadratic, stress, scale) + inertia
        matrix = elastic.copy()
        add_stiffness(cables, point.tendons, now * tension, matrix)
        definite, factor = factorise(matrix)
        if not definite:  # under large tensions: without what they add it still goes the right way
            definite, factor = factorise(elastic)
        if not definite:
            break
        columns = np.empty((r, m + 4))
        columns[:, 0] = -out
        columns[:, 1 : m + 1] = now * point.tendons.jacobian.T
        columns[:, m + 1 :] = body.tip.T
        solve(factor, columns)
        solved = np.ascontiguousarray(columns.T)
        y, answer, of_tip = solved[0], solved[1 : m + 1], solved[m + 1 :]
        compliance = point.tendons.jacobian @ answer.T
        if len(given):
            wanted = given
        else:
            free = point.tendons.displacement + point.tendons.jacobian @ y - compliance @ tension
            held = np.isfinite(wound)
            for i in range(m):
                compliance[i, i] += cables.axial_compliance[i]
            wanted = pivoted(compliance, wound - free, held, held & (tension > 0.0))
        q = q + y + (wanted - tension) @ answer
        if not np.isfinite(q.sum()):
            break
        tension, point = wanted, point_at(body, q)
    return False, q, tension, point, weight, np.inf


def _backward_difference(last: ReducedMotion, h: float) -> tuple[float, np.ndarray]:
    """a and b (k,) of d eps / dt = a eps + b at the end of a step of h seconds: the second backward difference, the first
    where the step before was another.
    """
    if abs(last.step - h) > 1e-9 * h:
        return 1.0 / h, -last.point.strain / h
    return 1.5 / h, (last.strain_before - 4.0 * last.point.strain) / (2.0 * h)
