"""Motion in reduced coordinates: the full model's scheme (`simulation.dynamics`) in r unknowns.

    M_r = Phi^T M Phi,     g(q) = J^T (eps + beta d eps / dt + rho eta) - Phi^T f_weight - H^T lambda,

integrated by generalized-alpha. The strains eps(q) of the reduced elasticity are objective, and so is Kelvin-Voigt's damping
with their second backward difference and the creep of `simulation.viscosity` (rho, held strain eta); beta, rho and T are the same
in the whole robot. Each Newton step has its own factor, which is cheap
here, and the correction that this factor still gives after the step decides whether another one is needed.
"""

import dataclasses

import numpy as np

from gravcomp.reduction.cholesky import factorise, solve
from gravcomp.reduction.reduced_cables import ReducedTendons, add_stiffness, lacking, tendons_at
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.simulation.generalized_alpha import DynamicsOptions, GeneralizedAlpha
from gravcomp.simulation.statics import CableInput
from gravcomp.simulation.viscosity import branch

_MOST_ITERATIONS = 16


@dataclasses.dataclass(frozen=True)
class ReducedMotion:
    """A state of motion: q, velocity, acceleration (r,), tension (m,), the cables there, the forces g (r,), the strains (k,) now
    and one step before and those held by the branch that creeps, that step in s, the norm of the forces out of balance in N, and whether the step converged."""

    q: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    tension: np.ndarray
    tendons: ReducedTendons
    force: np.ndarray
    strain: np.ndarray
    strain_before: np.ndarray
    held: np.ndarray
    step: float = 0.0
    residual: float = 0.0
    converged: bool = True


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
        `simulation.viscosity`."""
        self.model, self.options = model, options
        self._mass = mass
        self._damping_time, self._creep_ratio = (damping_time, creep[0]) if options.damping == "kelvin_voigt" else (0.0, 0.0)
        self._creep_time = creep[1]
        self._tolerance = tolerance * length
        self._released = np.full(len(model.cables.rest_length), np.nan)
        self._tip = np.ascontiguousarray(model.section_change[-1, 0])
        self.place(np.zeros(model.size), np.zeros(len(self._released)), np.zeros(3))

    def place(self, q: np.ndarray, tension: np.ndarray, gravity: np.ndarray) -> None:
        """Start at rest at q (r,) under the tensions (m,) and gravity (3,), with the acceleration that follows."""
        tendons = tendons_at(self.model.cables, q)
        inner, _, strain = self.model.elasticity.evaluate(q)
        force = inner - self.model.weight @ gravity - tension @ tendons.jacobian
        acceleration = np.linalg.solve(self._mass, -force)
        self.state = ReducedMotion(q, np.zeros_like(q), acceleration, tension, tendons, force, strain, strain, np.zeros_like(strain))

    def go_on(self, q: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, tension: np.ndarray) -> None:
        """Take over a motion that another model found: q, velocity and acceleration (r,), tension (m,).

        The forces are taken to be those that the acceleration needs; this model's own would jar its highest frequencies.
        """
        force, drag = -self._mass @ acceleration, self._rayleigh(q)
        if drag is not None:
            force -= drag @ velocity
        strain = self.model.elasticity.evaluate(q)[2]
        self.state = ReducedMotion(q, velocity, acceleration, tension, tendons_at(self.model.cables, q), force, strain, strain, np.zeros_like(strain))

    def step(self, gravity: np.ndarray, cables: CableInput, h: float) -> ReducedMotion:
        """One step of h seconds; `converged` is False when Newton's method did not settle, the state is then the old one."""
        model, last = self.model, self.state
        scheme = GeneralizedAlpha.of(h, self.options.spectral_radius)
        now, before = 1.0 - scheme.alpha_f, scheme.alpha_f
        rate, history = _backward_difference(last, h)
        decay, gain = branch(h, self._creep_time)
        scale = 1.0 + self._damping_time * rate + self._creep_ratio * gain
        offset = self._damping_time * history + self._creep_ratio * (decay * last.held - gain * last.strain)
        drag = self._rayleigh(last.q)
        inertia = ((1.0 - scheme.alpha_m) * scheme.acceleration_rate) * self._mass
        if drag is not None:
            inertia = inertia + (now * scheme.velocity_rate) * drag
        weight = model.weight @ gravity
        velocity_0, acceleration_0 = scheme.predict(last.velocity, last.acceleration)
        q, tension, tendons, factor = last.q, last.tension, last.tendons, None
        for _ in range(_MOST_ITERATIONS):
            inner, stiffness, strain = model.elasticity.evaluate(q, scale, offset)
            velocity = velocity_0 + scheme.velocity_rate * (q - last.q)
            acceleration = acceleration_0 + scheme.acceleration_rate * (q - last.q)
            force = inner - weight - tension @ tendons.jacobian
            middle = (1.0 - scheme.alpha_m) * acceleration + scheme.alpha_m * last.acceleration
            out = self._mass @ middle + now * force + before * last.force
            if drag is not None:
                out += drag @ (now * velocity + before * last.velocity)
            if factor is not None:
                pull = lacking(model.cables, tendons, tension, compliance, self._released if cables.wound is None else cables.wound)
                left = of_tip @ out - self._tip @ (pull @ answer)
                if left @ left < self._tolerance**2:
                    residual = float(np.sqrt(out @ model.force_norm @ out))
                    held = decay * last.held + gain * (strain - last.strain)
                    self.state = ReducedMotion(
                        q, velocity, acceleration, tension, tendons, force, strain, last.strain, held, h, residual
                    )
                    return self.state
            factor = self._factor(now * stiffness + inertia, tendons, now * tension)
            if factor is None:
                break
            columns = np.column_stack([-out, now * tendons.jacobian.T, self._tip.T])
            solve(factor, columns)
            y, answer, of_tip = columns[:, 0], columns[:, 1:-3].T, columns[:, -3:].T
            compliance = tendons.jacobian @ answer.T
            free = tendons.displacement + tendons.jacobian @ y - compliance @ tension
            compliance.ravel()[:: len(compliance) + 1] += model.cables.axial_compliance
            wanted = cables.tensions(compliance, free, tension > 0.0)
            q = q + (y + (wanted - tension) @ answer)
            if not np.isfinite(q.sum()):
                break
            tension, tendons = wanted, tendons_at(self.model.cables, q)
        self.state = dataclasses.replace(last, converged=False)
        return self.state

    def _factor(self, matrix: np.ndarray, tendons: ReducedTendons, tension: np.ndarray) -> np.ndarray | None:
        """The Cholesky factor of the matrix (r, r), of which the lower triangle is read, with the stiffness of the cables' tensions (m,), without it where
        that is not positive definite, None where neither is."""
        for pull in (tension, np.zeros_like(tension)):
            stiffness = matrix.copy()
            add_stiffness(self.model.cables, tendons, pull, stiffness)
            definite, factor = factorise(stiffness)
            if definite:
                return factor
        return None

    def _rayleigh(self, q: np.ndarray) -> np.ndarray | None:
        """alpha M + beta K(q) (r, r); None where the material damps."""
        options = self.options
        if options.damping != "rayleigh":
            return None
        stiffness = np.tril(self.model.elasticity.evaluate(q)[1])
        stiffness += np.tril(stiffness, -1).T
        return options.rayleigh_mass * self._mass + options.rayleigh_stiffness * stiffness


def _backward_difference(last: ReducedMotion, h: float) -> tuple[float, np.ndarray]:
    """a and b (k,) of d eps / dt = a eps + b at the end of a step of h seconds: the second backward difference, the first
    where the step before was another."""
    if abs(last.step - h) > 1e-9 * h:
        return 1.0 / h, -last.strain / h
    return 1.5 / h, (last.strain_before - 4.0 * last.strain) / (2.0 * h)
