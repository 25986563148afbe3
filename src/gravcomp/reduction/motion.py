"""Motion in reduced coordinates, with the scheme of the full model (`full_model.dynamics`) in r unknowns.

    M_r = Phi^T M Phi,     g(q) = J^T (eps + beta d eps / dt + sum rho_i eta_i) + f_deviation - Phi^T f_weight - H^T lambda,

integrated by generalized-alpha. The strains eps(q) of the reduced elasticity are objective; so are Kelvin-Voigt damping with
their second backward difference and the branches of `full_model.viscosity` (rho, held strain eta). beta, rho and T are the same
in the whole robot.
"""

import dataclasses

import numpy as np

from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.generalized_alpha import DynamicsOptions, GeneralizedAlpha
from gravcomp.full_model.motion import ExternalForce
from gravcomp.reduction.body import Point, body_of, elastic_force, elastic_stiffness, kept_stiffness, point_at
from gravcomp.reduction.memory import Memory
from gravcomp.reduction.motion_step import motion_step
from gravcomp.reduction.reduced_cables import ReducedTendons, add_stiffness
from gravcomp.reduction.reduced_model import ReducedModel


@dataclasses.dataclass(frozen=True)
class ReducedMotion:
    """A state of motion at the end of a step.

    q, velocity and acceleration (r,); tension (m,) in N; point: the model at q; force (r,): g; strain_before (k,): strain one
    step before; memory: of the branches; step: length of the last step in s; residual: norm of the force out of balance in N.
    """

    q: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    tension: np.ndarray
    point: Point
    force: np.ndarray
    strain_before: np.ndarray
    memory: Memory
    step: float = 0.0
    residual: float = 0.0
    converged: bool = True

    @property
    def tendons(self) -> ReducedTendons:
        """The cables at q."""
        return self.point.tendons


class ReducedDynamicSolver:
    """Integrates the motion of a reduced model. Owns the current `state`."""

    def __init__(
        self,
        model: ReducedModel,
        mass: np.ndarray,
        damping_time: float,
        length: float,
        options: DynamicsOptions | None = None,
        tolerance: float = 1e-6,
        branches: tuple[tuple[float, float], ...] = (),
    ):
        """Start at rest with the straight robot.

        Parameters
        ----------
        model
            Reduced model.
        mass
            (r, r) mass in the coordinates.
        damping_time
            Of the Kelvin-Voigt law in s.
        length
            Of the robot in m.
        options
            Default `DynamicsOptions()`.
        tolerance
            Correction of the tip's displacement, as a fraction of the length, that ends a step.
        branches
            Rho, and T in s, of the branches of `full_model.viscosity`.

        """
        options = options or DynamicsOptions()
        self.model, self.options = model, options
        self._mass = mass
        self._damping_time, self._branches = (damping_time, branches) if options.damping == "kelvin_voigt" else (0.0, ())
        self._tolerance = tolerance * length
        self._body, self._kept = body_of(model), kept_stiffness(model)
        self.place(np.zeros(model.size), np.zeros(len(model.cables.rest_length)), np.zeros(3))

    def place(self, q: np.ndarray, tension: np.ndarray, gravity: np.ndarray) -> None:
        """Start at rest at q (r,) under the tensions (m,) and gravity (3,), with the acceleration that they cause."""
        point = point_at(self._body, q, np.zeros(len(tension)))
        force = elastic_force(point, point.strain) - self.model.weight @ gravity - tension @ point.tendons.jacobian
        acceleration = np.linalg.solve(self._mass, -force)
        memory = Memory.of(self._branches, q, point.strain)
        self.state = ReducedMotion(q, np.zeros_like(q), acceleration, tension, point, force, point.strain, memory)

    def take_over(
        self, q: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, tension: np.ndarray, memory: Memory | None = None
    ) -> None:
        """Continue a motion of another model: q, velocity and acceleration (r,), tension (m,), memory (default: relaxed).

        The forces are set to those that the acceleration needs; the forces of this model would excite its highest frequencies.
        """
        point = point_at(self._body, q, np.zeros(len(tension)))
        force = -self._mass @ acceleration - self._rayleigh(point, q, tension) @ velocity
        memory = memory or Memory.of(self._branches, q, point.strain)
        self.state = ReducedMotion(q, velocity, acceleration, tension, point, force, point.strain, memory)

    def step(self, gravity: np.ndarray, cables: CableInput, h: float, external: ExternalForce | None = None) -> ReducedMotion:
        """Take one step of h seconds. If Newton's method does not converge, `converged` is False and the state is the old one.

        external: force (r,) in N that acts in addition, of the last q (r,).
        """
        model, last = self.model, self.state
        scheme = GeneralizedAlpha.of(h, self.options.spectral_radius)
        now, before = 1.0 - scheme.alpha_f, scheme.alpha_f
        rate, history = _backward_difference(last, h)
        stiffer, held = last.memory.stress(h)
        scale = 1.0 + self._damping_time * rate + stiffer
        strain = last.point.strain
        offset = self._damping_time * history + held
        drag = self._rayleigh(last.point, last.q, last.tension)
        velocity_0, acceleration_0 = scheme.predict(last.velocity, last.acceleration)
        # Contribution of the last step's forces, including inertia, to the balance of this step.
        rest = self._mass @ ((1.0 - scheme.alpha_m) * acceleration_0 + scheme.alpha_m * last.acceleration) + before * last.force
        rest += drag @ (now * velocity_0 + before * last.velocity)
        inertia = ((1.0 - scheme.alpha_m) * scheme.acceleration_rate) * self._mass + (now * scheme.velocity_rate) * drag
        weight = model.weight @ gravity
        if external is not None:
            weight = weight + external(last.q)
        converged, q, tension, point, force, residual = motion_step(
            self._body, last.point, last.q, last.tension, rest, inertia, weight,
            *cables.arrays(last.tension.size), now, scale, offset, self._kept, self._tolerance,
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
            memory=last.memory.after(q, point.strain, h),
            step=h,
            residual=residual,
        )
        return self.state

    def _rayleigh(self, point: Point, q: np.ndarray, tension: np.ndarray) -> np.ndarray:
        """Return alpha M + beta K (r, r) of `full_model.rayleigh`; zeros without Rayleigh damping.

        point: the model at q (r,); tension (m,) of the cables in N.
        """
        options = self.options
        if options.damping != "rayleigh":
            return np.zeros_like(self._mass)
        stiffness = elastic_stiffness(self._body, point, q, point.strain, 1.0, self._kept)
        add_stiffness(self._body.cables, point.tendons, tension, stiffness)
        stiffness = np.tril(stiffness)
        stiffness += np.tril(stiffness, -1).T
        return options.rayleigh_mass * self._mass + options.rayleigh_stiffness * stiffness


def _backward_difference(last: ReducedMotion, h: float) -> tuple[float, np.ndarray]:
    """Return a and b (k,) of d eps / dt = a eps + b at the end of a step of h seconds.

    It is the second backward difference, or the first one if the last step had another length.
    """
    if abs(last.step - h) > 1e-9 * h:
        return 1.0 / h, -last.point.strain / h
    return 1.5 / h, (last.strain_before - 4.0 * last.point.strain) / (2.0 * h)
