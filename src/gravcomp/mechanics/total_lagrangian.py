"""Internal forces and tangent stiffness of solid elements, total Lagrangian.

At every quadrature point, with F = I + du/dX, E = (F^T F - I) / 2 and S the second Piola-Kirchhoff stress (Bathe 1996, 6.3):

    f = sum w B^T S,      K = sum w (B^T D B + grad N . S grad N),      D = dS/dE,   B = dE/dq.

S and D come from the material's law (`materials.laws`) and its fibres; `assembly` sums them. Damping and creep add the stress of
`viscous_strain`. Quadratic tetrahedra have one pressure each (`materials.volume`).
"""

import copy

import numpy as np

from gravcomp.materials.constants import MaterialConstants
from gravcomp.mechanics import assembly, kinematics
from gravcomp.mechanics.block_matrix import BlockMatrix, BlockPattern
from gravcomp.mechanics.element_arrays import reference_geometry, scatter_positions
from gravcomp.mechanics.fibre_directions import scaled_fibres
from gravcomp.mechanics.viscous_strain import ViscousStrain
from gravcomp.mesh import Mesh
from gravcomp.mesh.elements import mass_quadrature, shape_values, stiffness_quadrature


class SolidElements:
    """The elements of a mesh whose nodes are in the pattern's order, the clamped ones last.

    Attributes: mesh; constants; n_free: number of free nodes; gradients (k, p, 3, c) and weights (k, p) at the quadrature points;
    fibres (k, p, f, 6) of `fibre_directions`; averaged (k,): elements with one pressure, of their mean volume.
    """

    def __init__(self, mesh: Mesh, pattern: BlockPattern):
        """Raises MeshError for inverted or flat elements."""
        self.mesh = mesh
        self.constants = MaterialConstants.of(mesh)
        self.n_free = pattern.n // 3
        rule = stiffness_quadrature(mesh.kind)
        self.gradients, self.weights = reference_geometry(mesh, rule.points, rule.weights)
        self._connectivity = mesh.elements.astype(np.int64)
        self.fibres = scaled_fibres(mesh, rule.points)
        self.averaged = np.full(len(mesh.elements), mesh.kind == "tet10")
        self._solid = self._bundled()
        self._position = scatter_positions(mesh.elements, pattern)
        count = len(self.weights)
        self._elastic = ViscousStrain(np.zeros(count), np.zeros((*self.weights.shape, 6)), np.zeros(count, bool))

    def with_materials(self, mesh: Mesh) -> "SolidElements":
        """Return the elements with the materials of `mesh`, which is otherwise this mesh; they share the geometry."""
        other = copy.copy(self)
        other.mesh, other.constants = mesh, MaterialConstants.of(mesh)
        other.fibres = scaled_fibres(mesh, stiffness_quadrature(mesh.kind).points)
        other._solid = other._bundled()
        return other

    def _bundled(self) -> assembly.Solid:
        """Return what the compiled functions take."""
        constants = self.constants
        return assembly.Solid(
            self._connectivity, self.gradients, self.weights, constants.law, constants.values, self.fibres, self.averaged
        )

    def scale_stiffness(self, factor: np.ndarray) -> None:
        """Multiply the modulus of every element by `factor` (k,), that of its fibres as well."""
        self.constants.values[:, :2] *= factor[:, None]  # the laws' own constants are ratios
        self.fibres *= np.sqrt(factor)[:, None, None, None]

    def internal_force(self, u: np.ndarray, viscous: ViscousStrain | None = None) -> np.ndarray:
        """Return internal forces (n, 3) in N at displacements `u` (n, 3), with damping and creep if a viscous strain is given."""
        force = np.zeros_like(u)
        strain = viscous or self._elastic
        assembly.add_internal_force(u, viscous is not None, strain.factor, strain.past, self._solid, force)
        return force

    def assemble(
        self,
        u: np.ndarray,
        matrix: BlockMatrix,
        viscous: ViscousStrain | None = None,
        origin: np.ndarray | None = None,
    ) -> np.ndarray:
        """Add the tangent stiffness at displacements `u` (n, 3) to `matrix` and return the internal forces (n, 3) in N.

        With `origin` (n, 3), the displacements of the last iterate, the stress in grad N . S grad N is the one that the last
        Newton step predicted, S + D B du with S and D at its origin. Then the spurious stretch of a straight step along a curved
        path does not stiffen the next step (Magisano, Leonetti, Garcea 2017, mixed integration points). The stress of creep is
        predicted alike. In elements with damping both are left out of that term: the stress of damping along the axis is an
        artefact of the iteration and can make the tangent indefinite.
        """
        force = np.zeros_like(u)
        strain = viscous or self._elastic
        assembly.add_force_and_stiffness(
            u, viscous is not None, strain.factor, strain.past, strain.damped, u if origin is None else origin,
            origin is not None, self._solid, force, self._position, matrix.values,
        )  # fmt: skip
        return force

    def strains(self, u: np.ndarray) -> np.ndarray:
        """Return Green's strain (k, p, 6) at the quadrature points, in the order 11 22 33 12 23 13, shear doubled."""
        strain = np.empty((*self.weights.shape, 6))
        kinematics.strains(u, self._connectivity, self.gradients, strain)
        return strain

    def smallest_volume_ratio(self, u: np.ndarray) -> float:
        """Return the smallest det F of all quadrature points; below zero an element is turned inside out."""
        return kinematics.smallest_volume_ratio(u, self._connectivity, self.gradients)

    def energy(self, u: np.ndarray) -> float:
        """Return the elastic energy in J."""
        return assembly.total_energy(u, self._solid)

    def nodal_mass(self) -> np.ndarray:
        """Return (n,) the integral of density times shape function in kg: the mass that gravity acts on.

        It may be negative at corner nodes.
        """
        values, weights = self._mass_rule()
        mass = np.zeros(len(self.mesh.nodes))
        np.add.at(mass, self.mesh.elements, np.einsum("kp,pa,k->ka", weights, values, self.constants.density))
        return mass

    def element_mass(self) -> np.ndarray:
        """Return (k, c, c) the consistent mass of every element, between its nodes, in kg."""
        values, weights = self._mass_rule()
        return np.einsum("kp,pa,pb,k->kab", weights, values, values, self.constants.density, optimize=True)

    def add_mass(self, matrix: BlockMatrix, factor: float) -> None:
        """Add factor x consistent mass to `matrix`."""
        assembly.add_between_nodes(self.element_mass() * factor, self._position, matrix.values)

    def _mass_rule(self) -> tuple[np.ndarray, np.ndarray]:
        """Values (p, c) of the shape functions and weights (k, p) in m^3 of the rule for masses."""
        rule = mass_quadrature(self.mesh.kind)
        _, weights = reference_geometry(self.mesh, rule.points, rule.weights)
        return shape_values(self.mesh.kind, rule.points), weights
