"""Motion of the full model under gravity and cables.

Generalized-alpha (see `generalized_alpha`) with the consistent mass, damped by the materials' Kelvin-Voigt law and their creep
(see `viscosity`); or, for parity with the article, by Rayleigh's alpha M + beta K alone, K being that of the start of the step. The
cables' complementarity holds at the end of a step.
"""

import dataclasses

import numpy as np

from gravcomp.cables.tendons import TendonState
from gravcomp.full_model.generalized_alpha import DynamicsOptions, GeneralizedAlpha
from gravcomp.full_model.model import RobotModel
from gravcomp.full_model.statics import CableInput
from gravcomp.full_model.viscosity import Viscosity
from gravcomp.mechanics.block_matrix import NotPositiveDefinite
from gravcomp.mechanics.corotational import CorotationalElements
from gravcomp.mechanics.total_lagrangian import ViscousStrain


@dataclasses.dataclass
class Motion:
    """A state of motion: displacements u, velocity and acceleration (n, 3), tension (m,), the cables there, the forces g
    (3 n_free,), the strains (k, p, 6) now and one step before and those held by the branch that creeps, that step in s, and the largest
    force out of balance in N.
    """

    u: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    tension: np.ndarray
    tendons: TendonState
    force: np.ndarray
    strain: np.ndarray
    strain_before: np.ndarray
    held: np.ndarray
    step: float = 0.0
    residual: float = 0.0
    converged: bool = True


class DynamicSolver:
    """Integrates a model's motion; it owns the matrices and the current state."""

    def __init__(self, model: RobotModel, options: DynamicsOptions = DynamicsOptions(), tolerance: float = 1e-6):
        """tolerance: correction of a node's displacement, as a fraction of the robot's length, that ends a step."""
        if options.damping == "kelvin_voigt" and isinstance(model.elements, CorotationalElements):
            raise ValueError("corotational tetrahedra have no Kelvin-Voigt damping; choose damping 'rayleigh'")
        self.model = model
        self.options = options
        self._tolerance = tolerance * model.length
        self._matrix = model.new_matrix()
        self._start = model.new_matrix()
        self._mass = model.mass_matrix()
        self._viscosity = Viscosity(model.mesh) if options.damping == "kelvin_voigt" else None
        self.place(np.zeros_like(model.mesh.nodes))

    def place(self, u: np.ndarray, tension: np.ndarray | None = None, gravity: np.ndarray = np.zeros(3)) -> None:
        """Start at rest at the displacements `u` (n, 3) under `tension` (m,), with the acceleration that follows; the body has
        crept as far as it does.
        """
        model = self.model
        tension = np.zeros(model.tendons.count) if tension is None else tension
        tendons = model.tendons.state(model.mesh.nodes + u)
        force = self._forces(u, None, model.weight(gravity), tension, tendons)
        self._matrix.values[:] = self._mass.values
        acceleration = np.zeros_like(u)
        model.free(acceleration)[:] = self._matrix.factor().solve(-force)
        strain = model.elements.strains(u)
        self.state = Motion(
            u.copy(), np.zeros_like(u), acceleration, tension, tendons, force, strain, strain, np.zeros_like(strain)
        )

    def go_on(self, u: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, tension: np.ndarray) -> None:
        """Take over a motion that another model found: displacements, velocity and acceleration (n, 3), tension (m,).

        The forces are taken to be those that the acceleration needs; this model's own would jar its highest frequencies.
        """
        model = self.model
        force, drag = -self._mass.multiply(model.free(acceleration)), self._rayleigh(u)
        if drag:
            force -= drag(model.free(velocity))
        strain = model.elements.strains(u)
        tendons = model.tendons.state(model.mesh.nodes + u)
        self.state = Motion(u, velocity, acceleration, tension, tendons, force, strain, strain, np.zeros_like(strain))

    def step(self, gravity: np.ndarray, cables: CableInput, h: float) -> Motion:
        """One step of h seconds; `converged` is False when Newton's method did not settle, the state is then the old one."""
        model, last = self.model, self.state
        scheme = GeneralizedAlpha.of(h, self.options.spectral_radius)
        drag = self._rayleigh(last.u)
        viscous = self._viscous(h)
        weight = model.weight(gravity)
        u = last.u.copy()
        velocity_0, acceleration_0 = scheme.predict(model.free(last.velocity), model.free(last.acceleration))
        # Newton starts where the step does: a straight prediction would stretch a turning body, and the stress of that
        # stretch could make the tangent indefinite.
        tension, tendons = last.tension, last.tendons
        factor, origin, size = None, last.u, np.inf
        for _ in range(16):
            if factor is None:
                factor = self._factor(u, viscous, tension, tendons, scheme, origin)
                if factor is None:
                    break
                fresh, jacobian = True, tendons.jacobian
                answer = factor.solve((1.0 - scheme.alpha_f) * tendons.force_jacobian.T)
                compliance = jacobian @ answer + np.diag(model.tendons.axial_compliance)
            moved = model.free(u) - model.free(last.u)
            velocity = velocity_0 + scheme.velocity_rate * moved
            acceleration = acceleration_0 + scheme.acceleration_rate * moved
            force = self._forces(u, viscous, weight, tension, tendons)
            middle = (1.0 - scheme.alpha_m) * acceleration + scheme.alpha_m * model.free(last.acceleration)
            out = self._mass.multiply(middle) + (1.0 - scheme.alpha_f) * force + scheme.alpha_f * last.force
            if drag:
                out += drag((1.0 - scheme.alpha_f) * velocity + scheme.alpha_f * model.free(last.velocity))
            y = factor.solve(-out)
            free = tendons.displacement + jacobian @ y - (jacobian @ answer) @ tension
            wanted = cables.tensions(compliance, free, tension > 0.0)
            step = y + answer @ (wanted - tension)
            length = float(np.abs(step).max())
            if not np.isfinite(length):
                break
            if not fresh and length > 0.25 * size:  # a factor of elsewhere: it would lead astray
                factor = None
                continue
            fresh = False
            origin = u.copy()
            model.free(u)[:] += step
            tension, tendons = wanted, model.tendons.state(model.mesh.nodes + u)
            if length < self._tolerance:
                return self._finish(u, tension, tendons, viscous, weight, scheme, float(np.abs(out).max()))
            size = length
        self.state = dataclasses.replace(last, converged=False)
        return self.state

    def _finish(self, u, tension, tendons, viscous, weight, scheme: GeneralizedAlpha, residual: float) -> Motion:
        model, last = self.model, self.state
        velocity_0, acceleration_0 = scheme.predict(last.velocity, last.acceleration)
        velocity = velocity_0 + scheme.velocity_rate * (u - last.u)
        acceleration = acceleration_0 + scheme.acceleration_rate * (u - last.u)
        force = self._forces(u, viscous, weight, tension, tendons)
        strain = model.elements.strains(u)
        held = self._viscosity.held_after(strain, last.strain, last.held, scheme.h) if self._viscosity else last.held
        self.state = Motion(u, velocity, acceleration, tension, tendons, force, strain, last.strain, held, scheme.h, residual)
        return self.state

    def energy(self, gravity: np.ndarray) -> float:
        """Kinetic, elastic and potential energy in J of the present state under `gravity` (3,)."""
        model, state = self.model, self.state
        velocity = model.free(state.velocity)
        kinetic = 0.5 * velocity @ self._mass.multiply(velocity)
        return float(kinetic + model.elements.energy(state.u) - model.free(state.u) @ model.weight(gravity))

    def _viscous(self, h: float) -> ViscousStrain | None:
        """Damping and creep in a step of h seconds from the present state; None where Rayleigh's law damps."""
        if self._viscosity is None:
            return None
        last = self.state
        alike = abs(last.step - h) <= 1e-9 * h
        return self._viscosity.step(last.strain, last.strain_before if alike else None, last.held, h)

    def _forces(self, u, viscous: ViscousStrain | None, weight, tension, tendons) -> np.ndarray:
        """g = f_int - f_weight - H^T lambda (3 n_free,), f_int with the materials' damping and creep."""
        pull = tension @ tendons.force_jacobian if tension.any() else 0.0
        return self.model.free(self.model.elements.internal_force(u, viscous)) - weight - pull

    def _rayleigh(self, u: np.ndarray):
        """The function velocity (3 n_free,) -> (alpha M + beta K(u)) velocity; None where the materials damp."""
        options = self.options
        if options.damping != "rayleigh":
            return None
        self._start.values[:] = 0.0
        self.model.elements.assemble(u, self._start)
        self._start.values *= options.rayleigh_stiffness
        self._start.values += options.rayleigh_mass * self._mass.values
        return self._start.multiply

    def _factor(self, u, viscous: ViscousStrain | None, tension, tendons, scheme: GeneralizedAlpha, origin: np.ndarray):
        """The factorised matrix of a step; None when it is not positive definite even without the cables' stiffness."""
        model = self.model
        for with_cables in (True, False):
            self._matrix.values[:] = 0.0
            model.elements.assemble(u, self._matrix, viscous, origin)
            if with_cables and tension.any():
                model.tendons.add_stiffness(tendons, tension, self._matrix)
            if self.options.damping == "rayleigh":
                self._matrix.values += scheme.velocity_rate * self._start.values
            self._matrix.values *= 1.0 - scheme.alpha_f
            self._matrix.values += (1.0 - scheme.alpha_m) * scheme.acceleration_rate * self._mass.values
            try:
                return self._matrix.factor()
            except NotPositiveDefinite:
                continue
        return None
