"""The constant part of a robot's model: mesh, elements, cables, sections, weights.

Nodes are numbered level by level from the clamp, the clamped nodes last. The unknowns q are the first `n_free` rows of the
displacements u (n, 3), component by component within a node.
"""

import numpy as np

from gravcomp.cables.disks import disk_weights
from gravcomp.cables.routing import route_cables
from gravcomp.cables.tendons import Tendons, pieces_of
from gravcomp.description import Robot
from gravcomp.full_model.effectors import Effectors
from gravcomp.full_model.hung_loads import hung_weights
from gravcomp.mechanics.block_matrix import BlockMatrix, order_in_levels
from gravcomp.mechanics.corotational import CorotationalElements
from gravcomp.mechanics.total_lagrangian import SolidElements
from gravcomp.mesh import Mesh, body_mesh
from gravcomp.mesh.elements import constant_strain
from gravcomp.mesh.sections import section_functionals


class MeshedModel:
    """The finite-element model of a robot with the elements that its description has.

    Attributes: robot; mesh, renumbered; pattern of the stiffness; elements; tendons; effectors; body_weight and nodal_weight
    (n,): mass in kg that gravity acts on at each node, without and with payload, loads and disks; n_free: number of free nodes;
    length in m.
    """

    def __init__(self, robot: Robot, mesh: Mesh | None = None):
        """Build the model; `mesh` replaces the mesh of the robot's description.

        Raises MeshError for a body that cannot be meshed, a cable outside the body and parts that are not connected to the base.
        """
        self.robot = robot
        mesh = mesh or body_mesh(robot)
        routes = route_cables(robot, mesh)
        cliques = [mesh.elements]
        cliques += [nodes[None, :] for route in routes for nodes, _ in pieces_of(route)]
        order, self.pattern = order_in_levels(cliques, len(mesh.nodes), mesh.clamped)
        self.mesh = mesh = mesh.renumbered(order)
        self.disks = disk_weights(robot, mesh)
        self.n_free = self.pattern.n // 3
        kind = CorotationalElements if constant_strain(mesh.kind) else SolidElements
        self.elements = kind(mesh, self.pattern)
        self.tendons = Tendons(robot.cables, [r.renumbered(order) for r in routes], mesh.nodes, self.pattern)
        self.effectors = Effectors(mesh, robot.effectors.backbone_station)
        self.body_weight = self.elements.nodal_mass()
        self.nodal_weight = self.body_weight + robot.payload.mass * self.effectors.tip_weights
        self._hung = hung_weights(robot, mesh)
        for load, weights in zip(robot.loads, self._hung):
            self.nodal_weight = self.nodal_weight + load.mass * weights
        if self.disks is not None:
            self.nodal_weight = self.nodal_weight + self.disks.mass @ self.disks.rows[:, 0]
        self.length = robot.length
        self._section_rows: dict[float, np.ndarray] = {}

    @property
    def mass(self) -> float:
        """Mass of the body and its payload in kg."""
        return float(self.nodal_weight.sum())

    def new_matrix(self) -> BlockMatrix:
        """Return storage for a stiffness matrix."""
        return BlockMatrix(self.pattern)

    def mass_matrix(self) -> BlockMatrix:
        """Return the consistent mass of body and payload."""
        matrix = self.new_matrix()
        self.elements.add_mass(matrix, 1.0)
        if self.robot.payload.mass > 0.0:
            self._add_point_mass(matrix, self.robot.payload.mass, self.effectors.tip_weights)
        for load, weights in zip(self.robot.loads, self._hung):
            self._add_point_mass(matrix, load.mass, weights)
        if self.disks is not None:
            for mass, inertia, rows in zip(self.disks.mass, self.disks.inertia, self.disks.rows):
                for factor, weights in zip((mass, inertia, inertia), rows):
                    self._add_point_mass(matrix, factor, weights)
        return matrix

    def _add_point_mass(self, matrix: BlockMatrix, mass: float, weights: np.ndarray) -> None:
        """Add the inertia of a mass (kg) that moves with the weighted sum of the nodes, `weights` (n,)."""
        weights = weights[: self.n_free]
        nodes = np.flatnonzero(weights)
        a, b = (nodes[index] for index in np.tril_indices(len(nodes)))
        for i in range(3):
            np.add.at(matrix.values, self.pattern.position(3 * a + i, 3 * b + i), mass * weights[a] * weights[b])

    def section_rows(self, station: float) -> np.ndarray:
        """Return p, f_1 and f_2 (3, n) of the section at `station` (0 at the base to 1 at the tip), as functionals of the nodes.

        Raises MeshError where the body has no section.
        """
        if station not in self._section_rows:
            self._section_rows[station] = section_functionals(self.mesh, np.array([station * self.length]))
        return self._section_rows[station]

    def free(self, field: np.ndarray) -> np.ndarray:
        """Return the unknowns (3 n_free,) of a field on all nodes (n, 3), as a view if the field is contiguous."""
        return field[: self.n_free].reshape(-1)

    def weight(self, gravity: np.ndarray) -> np.ndarray:
        """Return the forces (3 n_free,) of gravity (3,) in N."""
        return np.outer(self.nodal_weight[: self.n_free], gravity).reshape(-1)
