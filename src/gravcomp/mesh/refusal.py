"""Meshes from numbers of elements whose elements are too distorted to trust are refused, with numbers of elements that work."""

import dataclasses
import itertools

from gravcomp.description import Elements, Robot
from gravcomp.mesh.division import divided_mesh
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.quality import mesh_quality

_LEAST_RATIO = 0.2


def require_well_shaped(robot: Robot, elements: Elements, mesh: Mesh) -> None:
    """Raise MeshError when the smallest Jacobian ratio of the mesh, made with `elements`, is below 0.2."""
    ratio = mesh_quality(mesh).jacobian_ratio
    if ratio >= _LEAST_RATIO:
        return
    better = well_shaped(robot, elements)
    advice = f"{_text(better)} would do" if better else "no number of elements up to 4 x as fine does better"
    raise MeshError(
        f"robot '{robot.name}': elements {_text(elements)} have a smallest Jacobian ratio of {ratio:.2g}; allowed: at least"
        f" {_LEAST_RATIO:g}. {advice[0].upper()}{advice[1:]}; without `elements` well-shaped ones are used"
    )


def well_shaped(robot: Robot, elements: Elements) -> Elements | None:
    """Return the first numbers, from `elements` upward, whose elements are shaped well enough; None where none are found."""
    tries = itertools.product((1, 1.5, 2, 4), (0, 1, 2, 3), (1, 2))
    for along, radial, around in sorted(tries, key=lambda t: t[0] * (elements.radial + t[1]) * t[2]):
        candidate = dataclasses.replace(
            elements,
            along=min(int(along * elements.along), 500),
            radial=min(elements.radial + radial, 8),
            around=min(around * elements.around, 48),
        )
        if is_well_shaped(robot, candidate):
            return candidate
    return None


def is_well_shaped(robot: Robot, elements: Elements) -> bool:
    """Return whether the mesh of the robot with these elements is not refused."""
    return mesh_quality(divided_mesh(robot, elements)).jacobian_ratio >= _LEAST_RATIO


def _text(elements: Elements) -> str:
    return f"{{around: {elements.around}, along: {elements.along}, radial: {elements.radial}}}"
