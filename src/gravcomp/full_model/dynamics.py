"""Motion of the full model under gravity and cables.

Generalized-alpha integration (see `generalized_alpha`) with the consistent mass. Damping is either the Kelvin-Voigt law and the
creep of the materials (see `viscosity`), or, for comparison with the article, Rayleigh's law (see `rayleigh`). The
complementarity of the cables holds at the end of a step.
"""

import dataclasses

import numpy as np

from gravcomp.cables.tendons import TendonState
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.generalized_alpha import DynamicsOptions, GeneralizedAlpha
from gravcomp.full_model.motion import ExternalForce, Motion
from gravcomp.full_model.payload import with_payload
from gravcomp.full_model.rayleigh import RayleighDamping
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.viscosity import Viscosity
from gravcomp.mechanics.block_matrix import BlockCholesky, NotPositiveDefinite
from gravcomp.mechanics.corotational import CorotationalElements
from gravcomp.mechanics.viscous_strain import ViscousStrain

_MOST_ITERATIONS = 16
# A factor of another state is used again while each step is at most this fraction of the one before.
_FACTOR_CONTRACTION = 0.25


class DynamicSolver:
    """Integrates the motion of a model. Owns the matrices and the current `state`."""

    def __init__(self, model: RobotModel, options: DynamicsOptions | None = None, tolerance: float = 1e-6):
        """Start at rest with the straight robot.

        options: default `DynamicsOptions()`; tolerance: correction of a node's displacement, as a fraction of the robot's
        length, that ends a step. Raises ValueError for Kelvin-Voigt damping of corotational tetrahedra.
        """
        options = options or DynamicsOptions()
        if options.damping == "kelvin_voigt" and isinstance(model.elements, CorotationalElements):
            raise ValueError("corotational tetrahedra have no Kelvin-Voigt damping; choose damping 'rayleigh'")
        self.model = model
        self.options = options
        self._tolerance = tolerance * model.length
        self._matrix = model.new_matrix()
        self._mass = model.mass_matrix()
        self._mass_product = self._mass.sparse()
        self._viscosity = Viscosity(model.mesh) if options.damping == "kelvin_voigt" else None
        self._rayleigh = RayleighDamping(model, self._mass, options) if options.damping == "rayleigh" else None
        self.place(np.zeros_like(model.mesh.nodes))

    def place(self, u: np.ndarray, tension: np.ndarray | None = None, gravity: np.ndarray | None = None) -> None:
        """Start at rest at the displacements u (n, 3), with the acceleration that the forces cause; creep has come to an end.

        tension (m,) in N, default 0; gravity (3,) in m/s^2, default 0.
        """
        model = self.model
        tension = np.zeros(model.tendons.count) if tension is None else tension
        gravity = np.zeros(3) if gravity is None else gravity
        tendons = model.tendons.state(model.mesh.nodes + u)
        force = self._forces(u, None, model.weight(gravity), tension, tendons)
        self._matrix.values[:] = self._mass.values
        acceleration = np.zeros_like(u)
        model.free(acceleration)[:] = self._matrix.factor().solve(-force)
        strain = model.elements.strains(u)
        self.state = Motion(
            u.copy(), np.zeros_like(u), acceleration, tension, tendons, force, strain, strain, self._relaxed(strain)
        )

    def take_over(
        self,
        u: np.ndarray,
        velocity: np.ndarray,
        acceleration: np.ndarray,
        tension: np.ndarray,
        held: np.ndarray | None = None,
    ) -> None:
        """Continue a motion of another model: displacements, velocity and acceleration (n, 3), tension (m,).

        held (b, k, p, 6): by the branches of the materials; default: they have relaxed.
        The forces are set to those that the acceleration needs; the forces of this model would excite its highest frequencies.
        """
        model = self.model
        tendons = model.tendons.state(model.mesh.nodes + u)
        force = -(self._mass_product @ model.free(acceleration))
        if self._rayleigh:
            self._rayleigh.update(u, tension, tendons)
            force -= self._rayleigh.force(model.free(velocity))
        strain = model.elements.strains(u)
        held = self._relaxed(strain) if held is None or self._viscosity is None else held
        self.state = Motion(u, velocity, acceleration, tension, tendons, force, strain, strain, held)

    def step(self, gravity: np.ndarray, cables: CableInput, h: float, external: ExternalForce | None = None) -> Motion:
        """Take one step of h seconds. If Newton's method does not converge, `converged` is False and the state is the old one.

        external: force (3 n_free,) in N that acts in addition, of the last displacements (n, 3).
        """
        model, last = self.model, self.state
        scheme = GeneralizedAlpha.of(h, self.options.spectral_radius)
        if self._rayleigh:
            self._rayleigh.update(last.u, last.tension, last.tendons)
        viscous = self._viscous(h)
        weight = model.weight(gravity)
        if external is not None:
            weight = weight + external(last.u)
        couple = with_payload(model, gravity, None)
        if couple is not None:
            weight = weight + couple.at(last.u)
        u = last.u.copy()
        velocity_0, acceleration_0 = scheme.predict(model.free(last.velocity), model.free(last.acceleration))
        # Newton starts at the displacements of the last step: a straight prediction would stretch a rotating body, and the
        # stress of that stretch could make the tangent indefinite.
        tension, tendons = last.tension, last.tendons
        factor, origin, size = None, last.u, np.inf
        for _ in range(_MOST_ITERATIONS):
            if factor is None:
                factor = self._factor(u, viscous, tension, tendons, scheme, origin)
                if factor is None:
                    break
                fresh, jacobian = True, tendons.jacobian
                answer = factor.solve((1.0 - scheme.alpha_f) * tendons.force_jacobian.T)
                compliance = jacobian @ answer + np.diag(model.tendons.stretch(tendons))
            moved = model.free(u) - model.free(last.u)
            velocity = velocity_0 + scheme.velocity_rate * moved
            acceleration = acceleration_0 + scheme.acceleration_rate * moved
            force = self._forces(u, viscous, weight, tension, tendons)
            middle = (1.0 - scheme.alpha_m) * acceleration + scheme.alpha_m * model.free(last.acceleration)
            out = self._mass_product @ middle + (1.0 - scheme.alpha_f) * force + scheme.alpha_f * last.force
            if self._rayleigh:
                out += self._rayleigh.force((1.0 - scheme.alpha_f) * velocity + scheme.alpha_f * model.free(last.velocity))
            y = factor.solve(-out)
            free = tendons.displacement + jacobian @ y - (jacobian @ answer) @ tension
            wanted = cables.tensions(compliance, free, tension > 0.0)
            step = y + answer @ (wanted - tension)
            length = float(np.abs(step).max())
            if not np.isfinite(length):
                break
            if not fresh and length > _FACTOR_CONTRACTION * size:
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

    def energy(self, gravity: np.ndarray) -> float:
        """Return kinetic, elastic and potential energy in J of the present state under gravity (3,)."""
        model, state = self.model, self.state
        velocity = model.free(state.velocity)
        kinetic = 0.5 * velocity @ (self._mass_product @ velocity)
        return float(kinetic + model.elements.energy(state.u) - model.free(state.u) @ model.weight(gravity))

    def _finish(
        self,
        u: np.ndarray,
        tension: np.ndarray,
        tendons: TendonState,
        viscous: ViscousStrain | None,
        weight: np.ndarray,
        scheme: GeneralizedAlpha,
        residual: float,
    ) -> Motion:
        """Set and return the state at the end of a converged step."""
        model, last = self.model, self.state
        velocity_0, acceleration_0 = scheme.predict(last.velocity, last.acceleration)
        velocity = velocity_0 + scheme.velocity_rate * (u - last.u)
        acceleration = acceleration_0 + scheme.acceleration_rate * (u - last.u)
        force = self._forces(u, viscous, weight, tension, tendons)
        strain = model.elements.strains(u)
        held = self._viscosity.held_after(strain, last.strain, last.held, scheme.h) if self._viscosity else last.held
        self.state = Motion(u, velocity, acceleration, tension, tendons, force, strain, last.strain, held, scheme.h, residual)
        return self.state

    def _relaxed(self, strain: np.ndarray) -> np.ndarray:
        """Return what relaxed branches hold; no branches with Rayleigh damping."""
        return self._viscosity.relaxed(strain) if self._viscosity else np.zeros((0, *strain.shape))

    def _viscous(self, h: float) -> ViscousStrain | None:
        """Return damping and creep of a step of h seconds from the present state; None with Rayleigh damping."""
        if self._viscosity is None:
            return None
        last = self.state
        same_step = abs(last.step - h) <= 1e-9 * h
        return self._viscosity.step(last.strain, last.strain_before if same_step else None, last.held, h)

    def _forces(
        self, u: np.ndarray, viscous: ViscousStrain | None, weight: np.ndarray, tension: np.ndarray, tendons: TendonState
    ) -> np.ndarray:
        """Return g = f_int - f_weight - H^T lambda (3 n_free,) in N; f_int includes the materials' damping and creep."""
        pull = tension @ tendons.force_jacobian if tension.any() else 0.0
        return self.model.free(self.model.elements.internal_force(u, viscous)) - weight - pull

    def _factor(
        self,
        u: np.ndarray,
        viscous: ViscousStrain | None,
        tension: np.ndarray,
        tendons: TendonState,
        scheme: GeneralizedAlpha,
        origin: np.ndarray,
    ) -> BlockCholesky | None:
        """Return the factorised matrix of a step; None if it is not positive definite.

        The stiffness of the cables is left out if the matrix is positive definite only without it.
        """
        model = self.model
        for with_cables in (True, False):
            self._matrix.values[:] = 0.0
            model.elements.assemble(u, self._matrix, viscous, origin)
            if with_cables and tension.any():
                model.tendons.add_stiffness(tendons, tension, self._matrix)
            if self._rayleigh:
                self._rayleigh.add_to(self._matrix, scheme.velocity_rate)
            self._matrix.values *= 1.0 - scheme.alpha_f
            self._matrix.values += (1.0 - scheme.alpha_m) * scheme.acceleration_rate * self._mass.values
            try:
                return self._matrix.factor()
            except NotPositiveDefinite:
                continue
        return None
