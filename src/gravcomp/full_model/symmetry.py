"""Turns and mirrors about the axis that map a robot's model onto itself, found and checked on its mesh.

Of a shape under gravity and cables, such a map makes a shape under mapped gravity with the cables changed over: what is computed
once is known several times. A round tube with three equal cables at equal angles on six elements around has six of them.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np

from gravcomp.description import Cable
from gravcomp.full_model.model import MeshedModel

# Of the length: how near a node's image lies to a node, how far the test's displacement goes along the robot, and at one node.
_NEAR, _MOVED, _SHAKEN = 1e-7, 0.05, 1e-5
# Of the largest force, weight and change of length: differences that are rounding.
_SAME = 1e-7
_TURN_SAME = 1e-6  # rad


@dataclass(frozen=True)
class Symmetry:
    """matrix (3, 3), orthogonal; nodes (n,) and cables (m,): the node and the cable onto which each one is mapped."""

    matrix: np.ndarray
    nodes: np.ndarray
    cables: np.ndarray

    def of_displacements(self, u: np.ndarray) -> np.ndarray:
        """Return the image of displacements (n, 3) of all nodes."""
        image = np.empty_like(u)
        image[self.nodes] = u @ self.matrix.T
        return image

    def of_unknowns(self, unknowns: np.ndarray) -> np.ndarray:
        """Return the image of unknowns (3 n_free,): free nodes are mapped onto free nodes."""
        moved = unknowns.reshape(-1, 3)
        image = np.empty_like(moved)
        image[self.nodes[: len(moved)]] = moved @ self.matrix.T
        return image.reshape(-1)

    def of_cables(self, values: np.ndarray) -> np.ndarray:
        """Return the image of one value for each cable (m,)."""
        image = np.empty_like(values)
        image[self.cables] = values
        return image


def symmetries(model: MeshedModel) -> list[Symmetry]:
    """Return the symmetries of a model but the identity; none for a robot without cables."""
    return [found for matrix in _candidates(model) if (found := _checked(model, matrix)) is not None]


def _candidates(model: MeshedModel) -> list[np.ndarray]:
    """Return the turns and mirrors (3, 3) about the axis that map the first cable's angle onto that of some cable."""
    angles = [_angle(cable) for cable in model.robot.cables]
    found: list[np.ndarray] = []
    for sign in (1.0, -1.0):
        seen = [0.0] if sign > 0.0 else []
        for angle in angles:
            turn = float(np.mod(angle - sign * angles[0] + _TURN_SAME, 2.0 * np.pi)) - _TURN_SAME
            if any(abs(turn - other) < _TURN_SAME for other in seen):
                continue
            seen.append(turn)
            c, s = np.cos(turn), np.sin(turn)
            found.append(np.array([[c, -sign * s, 0.0], [s, sign * c, 0.0], [0.0, 0.0, 1.0]]))
    return found


def _angle(cable: Cable) -> float:
    """Return the angle in rad at which a cable begins."""
    if cable.angle is not None:
        return cable.angle
    assert cable.via_points is not None  # Cable.__post_init__
    return float(np.arctan2(cable.via_points[0][1], cable.via_points[0][0]))


def _checked(model: MeshedModel, matrix: np.ndarray) -> Symmetry | None:
    """Return the symmetry of an orthogonal matrix (3, 3); None where it does not map the model onto itself.

    It is checked where it counts: on weights, internal forces and lengths of cables of a shape that is nowhere regular.
    """
    from scipy.spatial import cKDTree

    rest, length = model.mesh.nodes, model.length
    distance, nodes = cKDTree(rest).query(rest @ matrix.T)
    count = len(rest)
    if distance.max() > _NEAR * length or len(np.unique(nodes)) < count or (nodes[: model.n_free] >= model.n_free).any():
        return None
    centre = np.asarray(model.robot.payload.centre)
    if np.abs(matrix @ centre - centre).max() > _NEAR * length or not _alike(
        model.nodal_weight[nodes], model.nodal_weight, float(np.abs(model.nodal_weight).max())
    ):
        return None
    cables = _mapped_cables(model, matrix)
    if cables is None:
        return None
    found = Symmetry(matrix, nodes, cables)
    u = _irregular(model)
    image = found.of_displacements(u)
    forces = found.of_displacements(model.elements.internal_force(u))
    if not _alike(model.elements.internal_force(image), forces, float(np.abs(forces).max())):
        return None
    one, other = (model.tendons.state(rest + moved) for moved in (u, image))
    same_length = _alike(other.displacement, found.of_cables(one.displacement), _MOVED * length)
    sections, there = (model.effectors.sections(rest + moved)[:, 0] for moved in (u, image))
    return found if same_length and _alike(there, sections @ matrix.T, length) else None


def _mapped_cables(model: MeshedModel, matrix: np.ndarray) -> np.ndarray | None:
    """Return the cable (m,) onto which each one is mapped by its angle; None where one has no image."""
    cables = model.robot.cables
    found = []
    for cable in cables:
        angle = _angle(cable)
        there = matrix[:2, :2] @ (np.cos(angle), np.sin(angle))
        alike = [
            index
            for index, other in enumerate(cables)
            if np.abs((np.cos(_angle(other)), np.sin(_angle(other))) - there).max() < _TURN_SAME and _equal(cable, other)
        ]
        if len(alike) != 1:
            return None
        found.append(alike[0])
    return np.array(found) if len(set(found)) == len(found) else None


def _equal(cable: Cable, other: Cable) -> bool:
    """Whether cables have the same line and friction, and, where they are given by angles, the same way along the robot."""
    same = dataclasses.replace(other, name=cable.name, angle=cable.angle, via_points=cable.via_points)
    return same == cable and (cable.via_points is None) == (other.via_points is None)


def _irregular(model: MeshedModel) -> np.ndarray:
    """Return displacements (n, 3) in m that no symmetry leaves alone: a strain that grows along the robot, and noise."""
    rng = np.random.default_rng(0)
    rest, length = model.mesh.nodes, model.length
    along = np.clip(rest[:, 2:] / length, 0.0, None)
    u: np.ndarray = _MOVED * along * (rest @ rng.normal(size=(3, 3)))
    u[: model.n_free] += _SHAKEN * length * rng.normal(size=(model.n_free, 3))
    u[model.n_free :] = 0.0
    return u


def _alike(one: np.ndarray, other: np.ndarray, size: float) -> bool:
    return bool(np.abs(one - other).max(initial=0.0) <= _SAME * size)
