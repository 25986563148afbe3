"""Volume meshes from files, read with meshio."""

import logging

import numpy as np

from gravcomp.mesh.mesh import MeshError
from gravcomp.mesh.quadratic import raised_to_quadratic

VOLUME_SUFFIXES = (".msh", ".vtk", ".vtu")
_KINDS = {"tetra10": "tet10", "hexahedron20": "hex20", "tetra": "tet4"}


def read_volume(path: str) -> tuple[str, np.ndarray, np.ndarray]:
    """Return kind, nodes (n, 3) in the file's unit and elements (k, c) of the mesh in the file.

    Linear tetrahedra lock, so they are converted to quadratic ones, with a warning. Raises MeshError.
    """
    import meshio

    try:
        content = meshio.read(path)
    except (OSError, meshio.ReadError, SystemExit, ValueError) as error:
        raise MeshError(f"{path}: cannot be read as a mesh: {error}") from error
    found = next((name for name in _KINDS if any(block.type == name for block in content.cells)), None)
    if found is None:
        types = sorted({block.type for block in content.cells}) or ["none"]
        raise MeshError(f"{path}: contains cells of {', '.join(types)}; tetra10, hexahedron20 or tetra are needed")
    kind, blocks = _KINDS[found], [block.data for block in content.cells if block.type == found]
    used, elements = np.unique(np.vstack(blocks), return_inverse=True)
    nodes, elements = np.asarray(content.points, dtype=float)[used], elements.reshape(-1, blocks[0].shape[1])
    if kind == "tet4":
        logging.getLogger(__name__).warning(
            "%s: linear tetrahedra lock in bending; they are converted to quadratic ones with straight sides", path
        )
        kind = "tet10"
        nodes, elements = raised_to_quadratic(nodes, elements)
    return kind, nodes, elements
