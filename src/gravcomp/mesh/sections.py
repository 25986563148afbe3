"""Cross-sections of the body as linear functionals of its nodes.

For a height Z of the straight body, points of the section there are fitted by x(X, Y) = p + f_1 X + f_2 Y (least squares,
every point weighted by its share of the area). p is where the axis has gone, f_1 and f_2 are where the section's x and y
have gone; the axis' direction is d = f_1 x f_2 / |f_1 x f_2|. p, f_1 and f_2 are weighted sums of node positions.

A body that ends in a rounding has no section at its tip: there points of its last elements are fitted, along Z too.

On a body whose axis is bent at rest, Z is the arc length along the axis, and the section is perpendicular to it there.
"""

import functools
import hashlib
import threading
from collections import OrderedDict

import numpy as np

from gravcomp.mesh.elements import is_hexahedron, shape_gradients, shape_values
from gravcomp.mesh.embedding import locate
from gravcomp.mesh.local_coordinates import local_coordinates_from
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.tet_sections import near_tip, on_plane

_RINGS, _SPOKES = 9, 18
_GAUSS = np.polynomial.legendre.leggauss(3)

# Functionals (3, n) of a mesh by height, for the last meshes: a fit makes the same mesh again for each set of its parameters.
_known: OrderedDict[bytes, dict[float, np.ndarray]] = OrderedDict()
_REMEMBERED, _LARGEST = 2, 5000  # meshes, nodes: the functionals of a larger one take tens of MB
_guard = threading.Lock()


def section_functionals(mesh: Mesh, heights: np.ndarray) -> np.ndarray:
    """(3 s, n): rows p, f_1, f_2 of every height (s,), to be multiplied with node positions (n, 3).

    Raises MeshError where the body has no section.
    """
    known = _known_of(mesh)
    missing = [height for height in dict.fromkeys(heights.tolist()) if height not in known]
    if missing:
        known.update(zip(missing, _computed(mesh, missing)))
    return np.concatenate([known[height] for height in heights.tolist()] or [np.zeros((0, len(mesh.nodes)))])


def is_one_region(mesh: Mesh, height: float) -> bool:
    """Return whether the elements at a height are connected: a body that forks has sections of several regions."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    z = mesh.straight[mesh.elements][:, :, 2]
    slack = 1e-9 * mesh.length
    cut = mesh.elements[(z.min(axis=1) <= height + slack) & (z.max(axis=1) >= height - slack)]
    used, numbers = np.unique(cut, return_inverse=True)
    element = np.repeat(np.arange(len(cut)), cut.shape[1])
    shape = (len(cut) + len(used),) * 2
    links = coo_array((np.ones(cut.size), (element, len(cut) + numbers.ravel())), shape=shape)
    return len(cut) > 0 and int(connected_components(links, directed=False)[0]) == 1


def _known_of(mesh: Mesh) -> dict[float, np.ndarray]:
    """Return the known functionals by height of a mesh with these nodes and elements, to be added to."""
    if mesh.axis.bent or len(mesh.nodes) > _LARGEST:  # a bent axis is more than the nodes
        return {}
    content = hashlib.blake2b(mesh.kind.encode(), digest_size=16)
    for array in (mesh.nodes, mesh.straight, mesh.elements):
        content.update(array.tobytes())
    key = content.digest()
    with _guard:
        found = _known.setdefault(key, {})
        _known.move_to_end(key)
        while len(_known) > _REMEMBERED:
            _known.popitem(last=False)
    return found


def _computed(mesh: Mesh, heights: list[float]) -> np.ndarray:
    """Return the functionals (s, 3, n) of the heights."""
    rows = np.zeros((3 * len(heights), len(mesh.nodes)))
    layered = _layered(mesh)
    rounded = not _ends_flat(mesh)
    for index, height in enumerate(heights):
        if rounded and height > (1.0 - 1e-9) * mesh.length:
            places, area, nodes, weights = near_tip(mesh)
            design = np.column_stack([np.ones(len(places)), places])
        else:
            plane, area, nodes, weights = _in_section(mesh, height, layered)
            design = np.column_stack([np.ones(len(plane)), plane])
        normal = design.T @ (area[:, None] * design)
        scale = np.sqrt(np.diag(normal))
        if len(design) < 6 or not scale.all() or np.linalg.cond(normal / np.outer(scale, scale)) > 1e6:
            raise MeshError(f"the body has no cross-section at z = {height * 1e3:g} mm to fix the backbone to")
        fit = np.linalg.solve(normal, design.T * area)
        for row in range(3):
            np.add.at(rows[3 * index + row], nodes, fit[row][:, None] * weights)
    rows[np.abs(rows) < 1e-9 * np.abs(rows).max(axis=1, keepdims=True)] = 0.0
    return rows.reshape(len(heights), 3, -1)


def _ends_flat(mesh: Mesh) -> bool:
    """Whether the nodes at the tip span a face across the axis; that of a bent body from a file is so only nearly."""
    if mesh.axis.bent and not is_hexahedron(mesh.kind):
        return False
    tip = mesh.nodes[mesh.tip]
    return len(tip) >= 3 and bool(np.linalg.svd(tip - tip.mean(axis=0), compute_uv=False)[1] > 1e-3 * mesh.length)


def _in_section(mesh: Mesh, height: float, layered: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points of the section: places (q, 2), areas (q,), nodes and weights (q, c) of each."""
    if layered:
        return _in_layer(mesh, height)
    return _on_rings(mesh, height) if is_hexahedron(mesh.kind) else on_plane(mesh, height)


def _layered(mesh: Mesh) -> bool:
    """Whether all elements are hexahedra between two planes across the axis, as meshes of segments are."""
    if mesh.kind != "hex20":
        return False
    z = mesh.straight[mesh.elements][:, :, 2]
    slack = 1e-9 * mesh.length
    faces = ((0, 1, 2, 3, 8, 9, 10, 11), (16, 17, 18, 19), (4, 5, 6, 7, 12, 13, 14, 15))
    flat = all(np.ptp(z[:, face], axis=1).max() < slack for face in faces)
    return flat and float(np.abs(z[:, 0] + z[:, 4] - 2 * z[:, 16]).max()) < slack


def _in_layer(mesh: Mesh, height: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Gauss points of the section: places (q, 2), areas (q,), nodes and weights (q, 20) of each."""
    low, high = (mesh.straight[mesh.elements[:, corner], 2] for corner in (0, 4))
    slack = 1e-9 * mesh.length
    layer = (low < height - slack) & (high >= height - slack) if height > slack else low <= slack
    elements = mesh.elements[layer]
    part = np.clip(2.0 * (height - low[layer]) / (high - low)[layer] - 1.0, -1.0, 1.0)
    part[np.abs(np.abs(part) - 1.0) < 1e-9] = np.sign(part[np.abs(np.abs(part) - 1.0) < 1e-9])
    parts, which = np.unique(np.round(part, 12), return_inverse=True)  # mostly one: the elements lie between the same planes
    grid, values, slopes = (np.array(arrays)[which] for arrays in zip(*map(_gauss_points, parts.tolist())))
    straight = mesh.straight[elements][..., :2]
    jacobian = (straight.swapaxes(1, 2) @ slopes).reshape(-1, 2, 9, 2).swapaxes(1, 2)
    area = np.abs(np.linalg.det(jacobian)) * np.outer(_GAUSS[1], _GAUSS[1]).ravel()
    nodes, weights = np.repeat(elements, 9, axis=0), values.reshape(-1, 20)
    plane = (values @ straight).reshape(-1, 2)
    if mesh.axis.bent:
        # Between its end faces a quadratic element follows an arc only nearly: the points are found where they lie.
        points = mesh.axis.points(np.column_stack([plane, np.full(len(plane), height)]))
        tolerance = 1e-9 * mesh.length
        local, distance, found = local_coordinates_from("hex20", mesh.nodes[nodes], points, tolerance, grid.reshape(-1, 3))
        if not found.all():
            raise MeshError(
                f"the section at {height * 1e3:g} mm does not lie in its elements, by {distance.max() * 1e3:.3g} mm:"
                " use more elements along the robot"
            )
        local[np.abs(np.abs(local) - 1.0) < 1e-9] = np.sign(local[np.abs(np.abs(local) - 1.0) < 1e-9])
        weights = shape_values("hex20", local)
    return plane, area.ravel(), nodes, weights


@functools.lru_cache(maxsize=256)
def _gauss_points(part: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Local coordinates (9, 3) of the Gauss points of a hexahedron's section at the local coordinate `part`.

    Also returns its shape functions there (9, 20), and their derivatives (20, 18) by the first two coordinates, point by point.
    """
    grid = np.array([(a, b, part) for a in _GAUSS[0] for b in _GAUSS[0]])
    return grid, shape_values("hex20", grid), shape_gradients("hex20", grid)[..., :2].transpose(1, 0, 2).reshape(20, 18)


def _on_rings(mesh: Mesh, height: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points on rings over the section: places (q, 2), areas (q,), nodes and weights (q, c) of each."""
    plane, area = _sampled_plane(mesh, height)
    found, attached = locate(mesh, mesh.axis.points(np.column_stack([plane, np.full(len(plane), height)])))
    within = attached & (found.outside < 1e-6)
    return plane[within], area[within], found.nodes[within], found.weights[within]


def _sampled_plane(mesh: Mesh, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (q, 2) in the section at `height`, on rings that reach over the body there, and the area (q,) each stands for."""
    z = mesh.straight[mesh.elements][:, :, 2]
    slack = 1e-6 * mesh.length
    here = mesh.elements[(z.min(axis=1) <= height + slack) & (z.max(axis=1) >= height - slack)]
    if not len(here):
        raise MeshError(f"the body has no cross-section at z = {height * 1e3:g} mm to fix the backbone to")
    nodes = mesh.straight[np.unique(here)]
    radii = np.hypot(nodes[:, 0], nodes[:, 1])
    # A solid section is sampled from its middle, a tube from its inner wall: a thin wall would fall between two rings.
    middle, solid = locate(mesh, mesh.axis.points(np.array([[0.0, 0.0, height]])))
    inner = 0.0 if solid[0] and middle.outside[0] < 1e-6 else radii.min()
    radius, angle = np.meshgrid(
        inner + (radii.max() - inner) * (np.arange(_RINGS) + 0.5) / _RINGS,
        2 * np.pi * np.arange(_SPOKES) / _SPOKES,
        indexing="ij",
    )
    return np.column_stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()]), radius.ravel()
