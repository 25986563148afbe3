"""A robot's model projected on a reduced basis, u = Phi q with r coordinates q.

The elastic forces are polynomials in q (`strain_polynomials`), and what another law than "svk" adds (`law_deviation`). The
weight, the straight pieces of the cables and the cross-sections are linear in the nodes and so in q: Phi^T (m x g), e_k(q) =
e_k(0) + D_k q, sections(q) = sections(0) + S q.
"""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from gravcomp.cables.routing import route_cables
from gravcomp.cables.tendons import pieces_of
from gravcomp.full_model.observation import observe
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.reduction.cubature import Cubature
from gravcomp.reduction.law_deviation import LawDeviation
from gravcomp.reduction.reduced_cables import ReducedCables
from gravcomp.reduction.strain_polynomials import StrainPolynomials, strain_at
from gravcomp.rounding import REORDERED


@dataclass(frozen=True)
class ReducedModel:
    """A model in r reduced coordinates.

    basis (3 n_free, r); coordinates_of (r, 3 n_free): q = coordinates_of u; force_norm G (r, r): |f|^2 = g G g for nodal
    forces f with the reduced force g; elasticity, and the law's deviation from it; weight (r, 3): force of unit gravity;
    cables; section_rest (n + 1, 3, 3) and section_change (n + 1, 3, 3, r): as in `Effectors.sections`, the tip last; reach:
    the largest |q| for which the model may be used; error: largest tip error in m that was found when it was built.
    """

    basis: np.ndarray
    coordinates_of: np.ndarray
    force_norm: np.ndarray
    elasticity: StrainPolynomials
    deviation: LawDeviation
    weight: np.ndarray
    cables: ReducedCables
    section_rest: np.ndarray
    section_change: np.ndarray
    reach: float
    error: float

    @property
    def size(self) -> int:
        """Number r of coordinates."""
        return self.basis.shape[1]

    def of_first(self, modes: int, extra: int) -> "ReducedModel":
        """Return the model on its first modes, with the strains of these and the first `extra` principal ones."""
        return dataclasses.replace(
            self,
            basis=self.basis[:, :modes],
            coordinates_of=self.coordinates_of[:modes],
            force_norm=np.ascontiguousarray(self.force_norm[:modes, :modes]),
            elasticity=self.elasticity.of_first(modes, extra),
            deviation=self.deviation._replace(gradient=np.ascontiguousarray(self.deviation.gradient[:modes])),
            weight=self.weight[:modes],
            cables=self.cables._replace(change=self.cables.change[:modes]),
            section_change=np.ascontiguousarray(self.section_change[..., :modes]),
        )

    def observe(self, q: np.ndarray, answer: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the sections (n + 1, 3, 3) at q (r,), as in `Effectors.sections`, and `observation.observe` of them.

        answer (k, r): changes of q for which the changes of the effector are computed.
        """
        return _observed(self.section_rest, self.section_change, q, answer)

    def projected(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates (r,) of displacements (3 n_free,), and the strain of the elasticity there."""
        q = self.coordinates_of @ unknowns
        return q, strain_at(self.elasticity.linear, self.elasticity.quadratic, q)[1]

    def tip(self, q: np.ndarray) -> np.ndarray:
        """Return the position (3,) of the tip at q (r,) in m."""
        return self.section_rest[-1, 0] + self.section_change[-1, 0] @ q

    def outside(self, q: np.ndarray) -> float:
        """Return |q| / reach for q (r,): above 1, the shape is outside the trained range.

        |q| is the root of twice the linear elastic energy.
        """
        return math.sqrt(q @ q) / self.reach


@njit(cache=True, fastmath=REORDERED)
def _observed(
    section_rest: np.ndarray, section_change: np.ndarray, q: np.ndarray, answer: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Compiled `ReducedModel.observe`."""
    count, columns = len(section_rest) - 1, len(answer)
    sections, moved = section_rest.copy(), np.zeros((count + 1, 3, 3, columns))
    for s in range(count + 1):
        for v in range(3):
            seen = v == 0 or s == count  # the effector contains no direction of the backbone
            for i in range(3):
                line = section_change[s, v, i]
                value = 0.0
                for a in range(len(q)):
                    value += line[a] * q[a]
                sections[s, v, i] += value
                if not seen:
                    continue
                for k in range(columns):
                    row, value = answer[k], 0.0
                    for a in range(len(q)):
                        value += line[a] * row[a]
                    moved[s, v, i, k] = value
    values, change, orientation = observe(sections, moved)
    return sections, values, change, orientation


def project(
    model: RobotModel, basis: np.ndarray, elasticity: StrainPolynomials, cubature: Cubature, reach: float, error: float
) -> ReducedModel:
    """Return the model on a basis (3 n_free, r). reach: largest |q| to use it for; error: known tip error in m."""
    r = basis.shape[1]
    modes = fields(model, basis)
    matrix = model.new_matrix()
    model.elements.assemble(np.zeros_like(model.mesh.nodes), matrix)
    weighted = matrix.multiply(basis)
    pieces = [(cable, *piece) for cable, route in enumerate(route_cables(model.robot, model.mesh)) for piece in pieces_of(route)]
    change = np.array([np.einsum("n,ani->ai", w, modes[:, nodes]) for _, nodes, w in pieces]).reshape(-1, r, 3)
    cable = np.array([cable for cable, _, _ in pieces], dtype=np.int64)
    coordinates_of = np.linalg.solve(basis.T @ weighted, weighted.T)
    return ReducedModel(
        basis=basis,
        coordinates_of=coordinates_of,
        force_norm=coordinates_of @ coordinates_of.T,
        elasticity=elasticity,
        deviation=cubature.deviation(model.elements, basis),
        weight=np.einsum("anj,n->aj", modes, model.nodal_weight),
        cables=ReducedCables(
            rest=np.array([weights @ model.mesh.nodes[nodes] for _, nodes, weights in pieces]).reshape(-1, 3).T.copy(),
            change=np.ascontiguousarray(change.transpose(1, 2, 0), dtype=np.float32),
            cable=cable,
            first=np.searchsorted(cable, np.arange(model.tendons.count + 1)),
            rest_length=model.tendons.rest_length,
            axial_compliance=model.tendons.axial_compliance,
            friction=model.tendons.friction.coefficient,
            sheath_angle=model.tendons.friction.sheath_angle,
            free_length=model.tendons.friction.free_length,
        ),
        section_rest=model.effectors.sections(model.mesh.nodes),
        section_change=section_changes(model, basis),
        reach=reach,
        error=error,
    )


def section_changes(model: RobotModel, basis: np.ndarray) -> np.ndarray:
    """Return changes (n + 1, 3, 3, r) of the sections of `Effectors.sections` by the coordinates of a basis (3 n_free, r)."""
    return np.ascontiguousarray(np.stack([model.effectors.sections(field) for field in fields(model, basis)], axis=-1))


def fields(model: RobotModel, basis: np.ndarray) -> np.ndarray:
    """Return the modes (r, n, 3) of a basis (3 n_free, r) on all nodes."""
    modes = np.zeros((basis.shape[1], len(model.mesh.nodes), 3))
    modes[:, : model.n_free] = basis.T.reshape(-1, model.n_free, 3)
    return modes
