"""Volume meshes from files, read by meshio."""

import logging

import numpy as np

from gravcomp.mesh.mesh import MeshError
from gravcomp.mesh.quadratic import raised_to_quadratic

VOLUME_SUFFIXES = (".msh", ".vtk", ".vtu")
_KINDS = {"tetra10": "tet10", "hexahedron20": "hex20", "tetra": "tet4"}


def read_volume(path: str) -> tuple[str, np.ndarray, np.ndarray]:
    """Kind, nodes (n, 3) in the file's unit and elements (k, c) of the mesh in the file.

    Linear tetrahedra are raised to quadratic ones, with a warning: they lock. Raises MeshError.
    """
    import meshio

    try:
        content = meshio.read(path)
    except (OSError, meshio.ReadError, SystemExit, ValueError) as error:
        raise MeshError(f"{path}: cannot be read as a mesh: {error}") from error
    for found, kind in _KINDS.items():
        blocks = [block.data for block in content.cells if block.type == found]
        if blocks:
            break
    else:
        types = sorted({block.type for block in content.cells}) or ["none"]
        raise MeshError(f"{path}: has cells of {', '.join(types)}; tetra10, hexahedron20 or tetra are needed")
    used, elements = np.unique(np.vstack(blocks), return_inverse=True)
    nodes, elements = np.asarray(content.points, dtype=float)[used], elements.reshape(-1, blocks[0].shape[1])
    if kind == "tet4":
        logging.getLogger(__name__).warning(
            "%s: linear tetrahedra lock in bending; they are raised to quadratic ones with straight sides", path
        )
        kind = "tet10"
        nodes, elements = raised_to_quadratic(nodes, elements)
    return kind, nodes, elements
