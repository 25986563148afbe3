"""Closed surfaces from files: trimesh checks them, Gmsh fills them with quadratic tetrahedra.

Gmsh is an optional dependency (`pip install gmsh`); its wheel needs the system libraries libglu1-mesa, libgl1, libxcursor1,
libxft2 and libxinerama1.
"""

from typing import Any

import numpy as np

from gravcomp.mesh.mesh import MeshError

SURFACE_SUFFIXES = (".stl", ".ply", ".obj")
_GMSH_TET10 = 11
# Gmsh and VTK number the last two edges of a tetrahedron in opposite order.
_VTK_ORDER = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]


def mesh_surface(path: str, element_size: float) -> tuple[str, np.ndarray, np.ndarray]:
    """Return kind, nodes (n, 3) and elements (k, 10) of the body inside the surface, in the file's unit; so is element_size.

    Raises MeshError for a surface that is open, and if Gmsh is missing or fails.
    """
    check_surface(path)
    gmsh = _gmsh()
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.merge(path)
        # Split the facets into smooth faces where they meet at more than 40 degrees, so that rims stay sharp.
        gmsh.model.mesh.classifySurfaces(np.deg2rad(40.0), True, True, np.pi)
        gmsh.model.mesh.createGeometry()
        faces = [tag for _, tag in gmsh.model.getEntities(2)]
        gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(faces)])
        gmsh.model.geo.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", element_size)
        gmsh.option.setNumber("Mesh.MeshSizeMin", element_size / 4.0)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        _, connectivity = gmsh.model.mesh.getElementsByType(_GMSH_TET10)
    except Exception as error:  # Gmsh raises plain Exception
        raise MeshError(f"{path}: Gmsh cannot fill the surface: {error}") from error
    finally:
        gmsh.finalize()
    if len(connectivity) == 0:
        raise MeshError(f"{path}: Gmsh made no tetrahedra; is the surface closed and free of intersections?")
    index = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    index[tags.astype(np.int64)] = np.arange(len(tags))
    elements = index[connectivity.astype(np.int64)].reshape(-1, 10)[:, _VTK_ORDER]
    used, elements = np.unique(elements, return_inverse=True)
    return "tet10", coordinates.reshape(-1, 3)[used], elements.reshape(-1, 10)


def check_surface(path: str) -> None:
    """Raise MeshError for a file without a closed surface."""
    import trimesh

    try:
        surface: Any = trimesh.load(path, force="mesh")
    except Exception as error:  # the readers of trimesh pass on the exceptions of many libraries
        raise MeshError(f"{path}: cannot be read as a surface: {error}") from error
    if len(surface.faces) == 0:
        raise MeshError(f"{path}: has no triangles")
    if not surface.is_watertight:
        open_edges = len(surface.edges_unique) - len(surface.face_adjacency)
        raise MeshError(f"{path}: the surface is not closed ({open_edges} edges belong to one triangle); close its holes")
    if not surface.is_winding_consistent or surface.volume <= 0.0:
        raise MeshError(f"{path}: not all triangles face outward; repair their orientation")


def _gmsh() -> Any:
    """Return the module gmsh. Raises MeshError if it cannot be imported."""
    try:
        import gmsh
    except ImportError as error:
        raise MeshError(
            "meshing a surface needs Gmsh: pip install gmsh; its wheel needs the system libraries libglu1-mesa libgl1"
            f" libxcursor1 libxft2 libxinerama1 (apt-get install ...). Error: {error}"
        ) from error
    except OSError as error:
        raise MeshError(
            f"Gmsh is installed but a system library of its wheel is missing: {error}; apt-get install libglu1-mesa libgl1"
            " libxcursor1 libxft2 libxinerama1"
        ) from error
    return gmsh
