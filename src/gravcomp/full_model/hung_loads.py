"""Weights hung from points of the body, as weights on nodes."""

import numpy as np

from gravcomp.description import Robot
from gravcomp.mesh.embedding import embed
from gravcomp.mesh.mesh import Mesh, MeshError


def hung_weights(robot: Robot, mesh: Mesh) -> np.ndarray:
    """Return (loads, n) the part of each load that each node carries.

    Raises MeshError, naming the load and the distance, for a load whose point lies outside the body.
    """
    rows = np.zeros((len(robot.loads), len(mesh.nodes)))
    for index, load in enumerate(robot.loads):
        try:
            found = embed(mesh, np.array([load.at]))
        except MeshError as error:
            raise MeshError(f"loads[{index}]: {error}") from error
        np.add.at(rows[index], found.nodes[0], found.weights[0])
    return rows
