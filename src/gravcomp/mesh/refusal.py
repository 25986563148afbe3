"""Meshes of segments whose elements are too distorted to trust are refused, with numbers of elements that work."""

import dataclasses
import itertools

from gravcomp.description import Elements, Robot
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.quality import mesh_quality
from gravcomp.mesh.tube import tube_mesh

LEAST_JACOBIAN_RATIO = 0.2


def require_well_shaped(robot: Robot, elements: Elements, mesh: Mesh) -> None:
    """Raise MeshError when the smallest Jacobian ratio of the mesh, made with `elements`, is below 0.2."""
    ratio = mesh_quality(mesh).jacobian_ratio
    if ratio >= LEAST_JACOBIAN_RATIO:
        return
    better = well_shaped(robot, elements)
    advice = f"{_text(better)} would do" if better else "no number of elements up to 4 x as fine does better"
    raise MeshError(
        f"robot '{robot.name}': elements {_text(elements)} have a smallest Jacobian ratio of {ratio:.2g}; allowed: at least"
        f" {LEAST_JACOBIAN_RATIO:g}. {advice[0].upper()}{advice[1:]}; without `elements` well-shaped ones are used"
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
        if mesh_quality(tube_mesh(dataclasses.replace(robot, elements=candidate))).jacobian_ratio >= LEAST_JACOBIAN_RATIO:
            return candidate
    return None


def _text(elements: Elements) -> str:
    return f"{{around: {elements.around}, along: {elements.along}, radial: {elements.radial}}}"
