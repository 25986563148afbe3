"""`axis: auto`: the axis of a body, the end that is its base, and the frame `soft_base` there.

The axis is the principal axis of the solid body, along which it is longest. The base is the end with the flatter face: the one
whose flat face covers more of the section just inside it. Where both ends are equally flat it is the thicker one, and with
equally thick ones the one nearer to the file's origin. The base lies in the middle of its flat face (of the section, where the
face is only a part of the end), with z into the body across that face; x is the file's axis most across z, the first of x, y, z
among equals.
"""

import dataclasses

import numpy as np

from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.plane_section import plane_section

# Second moments along the axis over those across it: 2 for a cylinder 1.2 times as long as wide. A ball has 1.
_SLENDER = 2.0
# Of the length: how deep below an end its section is taken; how far from an end its flat face may begin.
_DEPTH, _END = 0.03, 0.2
# Shares and areas that differ by less than this part count as equal.
_FLATTER, _THICKER = 0.2, 0.02
# A flat face that covers less than this share of the section is no base to clamp.
_FLAT = 0.3
# A flat face that covers more than this share is the whole end.
_WHOLE = 0.9
_ROUNDED_CLAMP = 0.02


@dataclasses.dataclass(frozen=True)
class Frame:
    """soft_base in a file: origin (3,) in the file's unit; rows of `rotation` (3, 3): its x, y, z; sentences on the choice.

    face: the nodes (b,) of the base's flat face; clamped: depth below the end, in the file's unit, up to which a base without a
    flat face is clamped, else 0.
    """

    origin: np.ndarray
    rotation: np.ndarray
    notes: tuple[str, ...]
    face: np.ndarray
    clamped: float = 0.0


@dataclasses.dataclass(frozen=True)
class _End:
    """One end: direction (3,) out of the body, flat share, area of the section, centre (3,), normal (3,), nodes of its face."""

    outward: np.ndarray
    share: float
    area: float
    centre: np.ndarray
    normal: np.ndarray
    face: np.ndarray


def automatic_frame(nodes: np.ndarray, triangles: np.ndarray, reversed_ends: bool, name: str) -> Frame:
    """Return the frame for the body inside the triangles, which face outward; `reversed_ends`: base and tip are exchanged.

    Raises MeshError for a body that is not longer than wide.
    """
    centre, moments = _moments(nodes, triangles)
    value, vector = np.linalg.eigh(moments)
    if value[2] < _SLENDER * value[1]:
        raise MeshError(
            f"{name}: axis: auto finds no axis: the body is not longer in one direction than in the others (second moments"
            f" {', '.join(f'{x / value[2]:.2f}' for x in value)} of the largest; the second may be up to {1 / _SLENDER:g});"
            " write axis: given with a transform"
        )
    axis = vector[:, 2] * np.sign(vector[np.argmax(np.abs(vector[:, 2])), 2])
    ends = [_end(nodes, triangles, centre, -axis), _end(nodes, triangles, centre, axis)]
    chosen, why = _base(ends)
    if reversed_ends:
        chosen, why = 1 - chosen, "the other one, as auto_reversed says"
    base = ends[chosen]
    flat = base.share >= _FLAT
    z = -base.normal if flat else -base.outward
    place = ", ".join(f"{x:.4g}" for x in base.centre)
    notes = [
        f"axis: {_direction(z)} of the file, from the base at ({place}) units",
        f"base: {why}; flat share {100 * ends[chosen].share:.0f} % (other end {100 * ends[1 - chosen].share:.0f} %), section"
        f" {base.area:.4g} (other end {ends[1 - chosen].area:.4g}) square units; auto_reversed exchanges the ends",
    ]
    rotation = np.array([(x := _across(z)), np.cross(z, x), z])
    notes.append(f"x of the robot: {_direction(rotation[0])} of the file")
    if flat:
        return Frame(base.centre, rotation, tuple(notes), base.face)
    depth = _ROUNDED_CLAMP * float(np.ptp(nodes @ z))
    notes.append(f"the base has no flat face: the first {100 * _ROUNDED_CLAMP:g} % of the body are clamped")
    return Frame(base.centre + depth * z, rotation, tuple(notes), base.face[:0], depth)


def _moments(nodes: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centroid (3,) and second moments about it over the volume (3, 3), from the tetrahedra below every triangle."""
    middle = nodes[np.unique(triangles)].mean(axis=0)
    corners = nodes[triangles] - middle
    volume = np.linalg.det(corners) / 6.0
    total = corners.sum(axis=1)
    centre = volume @ total / (4.0 * volume.sum())
    second = np.einsum("k,ki,kj->ij", volume, total, total) + np.einsum("k,kci,kcj->ij", volume, corners, corners)
    return centre + middle, second / (20.0 * volume.sum()) - np.outer(centre, centre)


def _end(nodes: np.ndarray, triangles: np.ndarray, centre: np.ndarray, outward: np.ndarray) -> _End:
    corners = nodes[triangles]
    height = (nodes - centre) @ outward
    top, length = float(height.max()), float(np.ptp(height))
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    normal = cross / np.maximum(2.0 * area, 1e-300)[:, None]
    middle = corners.mean(axis=1)
    near = ((middle - centre) @ outward > top - _END * length) & (normal @ outward > 0.5) & (area > 0.0)
    best: tuple[float, np.ndarray, np.ndarray, np.ndarray] | None = None
    for seed in np.flatnonzero(near)[np.argsort(-area[near])][:60]:
        level = (nodes - middle[seed]) @ normal[seed]
        if level.max() > 2e-3 * length:  # a step, not the end: the body goes on beyond it
            continue
        level = np.abs((middle - middle[seed]) @ normal[seed])
        face = near & (normal @ normal[seed] > 0.999) & (level < 2e-3 * length)
        covered = float(area[face].sum())
        if best is None or covered > 1.001 * best[0]:
            best = covered, area[face] @ middle[face] / covered, area[face] @ normal[face] / covered, np.unique(triangles[face])
    if best is not None:
        best = best[0], best[1], best[2] / np.linalg.norm(best[2]), best[3]
        below, inside = plane_section(nodes, triangles, best[1] - _DEPTH * length * best[2], best[2])
        if below > 0.0:
            share = min(best[0] / below, 1.0)
            # Where only a part of the end is flat, the middle of the whole end counts.
            centre = best[1] if share > _WHOLE else inside + ((best[1] - inside) @ best[2]) * best[2]
            return _End(outward, share, below, centre, best[2], best[3])
    below, middle_of = plane_section(nodes, triangles, centre + (top - _DEPTH * length) * outward, outward)
    return _End(outward, 0.0, below, middle_of + _DEPTH * length * outward, outward, np.zeros(0, dtype=int))


def _base(ends: list[_End]) -> tuple[int, str]:
    """Which end is the base, and why."""
    flatter = ends[0].share - ends[1].share
    if abs(flatter) > _FLATTER:
        return (0 if flatter > 0 else 1), "the end with the flatter face"
    thicker = ends[0].area - ends[1].area
    if abs(thicker) > _THICKER * max(ends[0].area, ends[1].area):
        return (0 if thicker > 0 else 1), "the thicker end"
    distance = [float(np.linalg.norm(end.centre)) for end in ends]
    return (0 if distance[0] <= distance[1] * (1.0 + 1e-6) else 1), "the end nearer to the origin, of two that look alike"


def _across(z: np.ndarray) -> np.ndarray:
    """Unit vector (3,) across z, nearest to the file's axis that is most across z."""
    along = np.abs(z)
    axis = np.eye(3)[int(np.flatnonzero(along <= along.min() + 0.1)[0])]
    x = axis - (axis @ z) * z
    return x / np.linalg.norm(x)


def _direction(vector: np.ndarray) -> str:
    """'-x', or the components of a direction along no axis of the file."""
    largest = int(np.argmax(np.abs(vector)))
    if abs(vector[largest]) > 1.0 - 1e-6:
        return f"{'-' if vector[largest] < 0 else '+'}{'xyz'[largest]}"
    return f"({', '.join(f'{x:.3f}' for x in vector)})"
