"""The error of a mesh, estimated from one shape: how much its strain jumps between elements.

Strain at the nodes, averaged over the elements that meet there, is more accurate than that in the elements. The energy of the
difference estimates that of the error (O. C. Zienkiewicz and J. Z. Zhu, "A simple error estimator and adaptive procedure for
practical engineering analysis", Int. J. Numer. Methods Eng. 24(2), 1987). The tip's deflection is too small by about the part of
the energy that the error has. Green's strain does not see how an element has turned, so long deflections are no exception.

On tapered tubes bent to a right angle the estimate is 0.5 to 1.1 times the distance from a finer mesh; released, where strain is
large at the clamp only, that of tetrahedra is several times too large (`src/test/test_recovered_strain.py`).
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from gravcomp.full_model.mesh_loads import mesh_loads, shapes_under
from gravcomp.full_model.model import MeshedModel
from gravcomp.mesh.elements import is_hexahedron, reference_nodes, shape_values, stiffness_quadrature
from gravcomp.mesh.robot_axis import rest_tip

# The most multiplications of a factor, some tenths of a second of one core: the loads take some fifty.
_MOST_WORK = 3e9
# How many times as long a step may take for one mesh, which is not to be compared with others.
_LONGEST = 2.0


class MeshEstimate(NamedTuple):
    """Estimate of a mesh's error, under the worst of the loads.

    error: of the tip over the length; load: its name; place: height in m around which the error is; element_length: how long
    elements are along the robot there, in m; released: only with the cables released, as with them a step takes too long.
    """

    error: float
    load: str
    place: float
    element_length: float
    released: bool = False


def too_long(model: MeshedModel) -> float:
    """Return how many times as long as it may a step of the model takes for meshes like it to be compared."""
    return float((model.pattern.size.astype(float) ** 3).sum()) / _MOST_WORK


def can_be_estimated(model: MeshedModel) -> bool:
    """Return whether a step is short enough for the error of the model's mesh to be estimated, which takes up to a minute."""
    return _short_enough(model) is not None


def estimated_error(model: MeshedModel) -> MeshEstimate | None:
    """Return the estimate under the loads of `mesh_loads`; None where no equilibrium is found or a step takes too long."""
    short = _short_enough(model)
    if short is None:
        return None
    released, model = short is not model, short
    loads = mesh_loads(model)
    found = shapes_under(model, loads)
    tip, _ = rest_tip(model.robot)
    estimates = []
    for load, shape, reached in zip(loads, found.shapes, found.tips):
        if shape is None:
            continue
        wrong, energy = _energies(model, shape)
        part = float(wrong.sum() / energy.sum())
        heights = model.mesh.straight[model.mesh.elements, 2]
        share = wrong / wrong.sum()
        error = part * float(np.linalg.norm(reached - tip)) / model.length
        place, long = float(share @ heights.mean(axis=1)), float(share @ np.ptp(heights, axis=1))
        estimates.append(MeshEstimate(error, load.name, place, long, released))
    return max(estimates, key=lambda estimate: estimate.error) if estimates else None


def _short_enough(model: MeshedModel) -> MeshedModel | None:
    """The model, or without its cables, which tie distant sections together, where a step of it is short enough."""
    if too_long(model) <= _LONGEST:
        return model
    if not model.robot.cables:
        return None
    released = MeshedModel(dataclasses.replace(model.robot, cables=()), model.mesh)
    return released if too_long(released) <= _LONGEST else None


def _energies(model: MeshedModel, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the energy (k,) in J of the error and of the strain itself in every element at displacements (n, 3)."""
    mesh, weights = model.mesh, model.elements.weights
    strain = model.elements.strains(shape)
    points = stiffness_quadrature(mesh.kind).points
    to_nodes = _terms(mesh.kind, reference_nodes(mesh.kind)) @ np.linalg.inv(_terms(mesh.kind, points))
    volume = weights.sum(axis=1)
    total, around = np.zeros((len(mesh.nodes), 6)), np.zeros(len(mesh.nodes))
    np.add.at(total, mesh.elements, np.einsum("cp,kpi,k->kci", to_nodes, strain, volume))
    np.add.at(around, mesh.elements, np.broadcast_to(volume[:, None], mesh.elements.shape))
    recovered = np.einsum("pc,kci->kpi", shape_values(mesh.kind, points), (total / around[:, None])[mesh.elements])
    shear, bulk = _moduli(model)
    # One pressure in each tetrahedron: its strain without change of volume is what the force follows from.
    of_error = shear * _distortion(recovered - strain)
    if is_hexahedron(mesh.kind):
        of_error = of_error + bulk * _dilatation(recovered - strain)
    of_strain = shear * _distortion(strain) + bulk * _dilatation(strain)
    return (weights * of_error).sum(axis=1), (weights * of_strain).sum(axis=1)


def _terms(kind: str, places: np.ndarray) -> np.ndarray:
    """Return the polynomials (n, p) that the values at the p quadrature points determine, at local coordinates (n, 3)."""
    x, y, z = places.T
    linear = [np.ones_like(x), x, y, z]
    return np.column_stack([*linear, x * y, y * z, z * x, x * y * z] if is_hexahedron(kind) else linear)


def _moduli(model: MeshedModel) -> tuple[np.ndarray, np.ndarray]:
    """Return mu and half of the bulk modulus (k, 1) in Pa of the elements."""
    first, shear = model.elements.constants.values[:, :1], model.elements.constants.values[:, 1:2]
    return shear, 0.5 * (first + 2.0 / 3.0 * shear)


def _distortion(strain: np.ndarray) -> np.ndarray:
    """Return the square (k, p) of the part of strains (k, p, 6) without change of volume."""
    square = (strain[..., :3] ** 2).sum(axis=-1) + 0.5 * (strain[..., 3:] ** 2).sum(axis=-1)
    return np.asarray(square - _dilatation(strain) / 3.0)


def _dilatation(strain: np.ndarray) -> np.ndarray:
    """Return the square (k, p) of the change of volume of small strains (k, p, 6)."""
    return np.asarray(strain[..., :3].sum(axis=-1) ** 2)
