"""Directions of the fibres at the quadrature points: helices about the robot's axis."""

import numpy as np

from gravcomp.description import Fibres
from gravcomp.mesh import Mesh
from gravcomp.mesh.elements import shape_values


def scaled_fibres(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Return the families A (k, p, f, 6) of `materials.fibres` at local points (p, 3); f = 0 without any fibres."""
    given = [material.fibres for material in mesh.materials]
    families = max(_families(fibres) for fibres in given)
    straight = np.einsum("pc,kci->kpi", shape_values(mesh.kind, points), mesh.straight[mesh.elements])
    result = np.zeros((*straight.shape[:2], families, 6))
    for number, (material, fibres) in enumerate(zip(mesh.materials, given)):
        here = mesh.region == number
        if fibres is None or not here.any():
            continue
        count = _families(fibres)
        scale = np.sqrt(fibres.ratio * material.youngs_modulus / count)
        for family, sign in enumerate((1.0, -1.0)[:count]):
            a = _directions(mesh, straight[here], sign * fibres.angle)
            x, y, z = np.moveaxis(a, -1, 0)
            result[here, :, family] = scale * np.stack([x * x, y * y, z * z, x * y, y * z, x * z], axis=-1)
    return result


def _families(fibres: Fibres | None) -> int:
    """Number of families: helices wind both ways, fibres along the axis and hoops need one."""
    if fibres is None:
        return 0
    return 1 if abs(np.sin(2 * fibres.angle)) < 1e-9 else 2


def _directions(mesh: Mesh, straight: np.ndarray, angle: float) -> np.ndarray:
    """Return unit vectors (..., 3) in the body at rest, at an angle (rad) to the axis, at points of the straightened robot."""
    x, y, s = np.moveaxis(straight, -1, 0)
    radius = np.maximum(np.hypot(x, y), np.finfo(float).tiny)
    zero = np.zeros_like(x)
    around, along = np.stack([-y / radius, x / radius, zero], axis=-1), np.stack([zero, zero, zero + 1.0], axis=-1)
    a = np.cos(angle) * along + np.sin(angle) * around
    if not mesh.axis.bent:
        return a
    rotation = mesh.axis.frames(s.ravel())[1].reshape(*s.shape, 3, 3)
    return np.einsum("...ij,...j->...i", rotation, a)
