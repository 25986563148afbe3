"""Routes of a robot's cables through its body at rest."""

import numpy as np

from gravcomp.description import Cable, Robot
from gravcomp.mesh.embedding import Embedding, embed
from gravcomp.mesh.mesh import Mesh, MeshError

# Largest distance of a via point outside its element, in local coordinates: the facets of the mesh cut a little off a round body.
_TOLERANCE = 0.1


def route_cables(robot: Robot, mesh: Mesh) -> list[Embedding]:
    """Return the via points of every cable, first to last, attached to the mesh.

    A cable that is given by angle and radius slides through every station of the mesh between its start and its end.
    Raises MeshError for a cable that leaves the body.
    """
    routes = []
    for cable in robot.cables:
        points = _via_points(robot, cable, mesh.stations)
        route = embed(mesh, points)
        worst = int(np.argmax(route.outside))
        if route.outside[worst] > _TOLERANCE:
            x, y, z = points[worst] * 1e3
            raise MeshError(f"cable '{cable.name}' leaves the body at ({x:.3g}, {y:.3g}, {z:.3g}) mm; it must run inside")
        routes.append(route)
    return routes


def _via_points(robot: Robot, cable: Cable, stations: np.ndarray) -> np.ndarray:
    """Return the via points (p, 3) of a cable in m."""
    if cable.via_points is not None:
        return np.array(cable.via_points)
    assert cable.angle is not None and cable.radius is not None  # a cable without via points has both
    end = robot.cable_end(cable)
    between = stations[(stations > cable.start + 1e-6 * robot.length) & (stations < end - 1e-6 * robot.length)]
    z = np.concatenate([[cable.start], between, [end]])
    x, y = cable.radius * np.cos(cable.angle), cable.radius * np.sin(cable.angle)
    return np.column_stack([np.full(len(z), x), np.full(len(z), y), z])
