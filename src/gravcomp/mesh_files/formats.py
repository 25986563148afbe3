"""Reading surfaces and volume meshes: STL, OBJ and PLY by trimesh; VTK, VTU, MSH and INP by meshio; STEP by Gmsh."""

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from gravcomp.mesh_files.cell_count import counted_cells
from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.raw_mesh import RawMesh

SURFACE_SUFFIXES = (".stl", ".obj", ".ply")
SOLID_SUFFIXES = (".step", ".stp")
MESH_SUFFIXES = (".vtk", ".vtu", ".msh", ".inp")
TRIANGLES_MAX = 1_000_000
"""A surface with more triangles is refused: reading and checking it takes gigabytes."""

# The names of cells in meshio, in the order of preference, with our names and their numbers of nodes.
_VOLUMES = {
    "tetra10": ("tet10", 10),
    "hexahedron20": ("hex20", 20),
    "hexahedron27": ("hex20", 20),
    "tetra": ("tet4", 4),
    "hexahedron": ("hex8", 8),
}
_SURFACES = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}
_SUPPORT = ("vertex", "line", "line3", *_SURFACES)


def read(path: Path, elements_max: int) -> RawMesh:
    """Return the mesh in the file. Raises MeshError: no such file, an unknown format, more cells than the limits, no cells."""
    if not path.is_file():
        raise MeshError(f"{path}: {'is a folder' if path.is_dir() else 'does not exist'}")
    suffix = path.suffix.lower()
    allowed = (*SURFACE_SUFFIXES, *MESH_SUFFIXES, *SOLID_SUFFIXES)
    if suffix not in allowed:
        raise MeshError(f"{path}: the format '{suffix}' is not read; allowed are {', '.join(allowed)}")
    _refuse_too_many(path, suffix, elements_max)
    if suffix in SURFACE_SUFFIXES:
        return _surface(path)
    if suffix in SOLID_SUFFIXES:
        from gravcomp.mesh_files.step_file import read_step

        return read_step(path)
    return _mesh(path)


def too_many(path: Path, found: str, elements_max: int) -> MeshError:
    """Return the error for a mesh with more elements than allowed; `found` says how many."""
    return MeshError(
        f"{path}: {found}; body.elements_max allows {elements_max}: use a coarser mesh, or raise elements_max (memory grows"
        " with it)"
    )


def _refuse_too_many(path: Path, suffix: str, elements_max: int) -> None:
    counted = counted_cells(path, suffix)
    if suffix in SURFACE_SUFFIXES:
        if counted > TRIANGLES_MAX:
            raise MeshError(f"{path}: has {counted} triangles; allowed are {TRIANGLES_MAX}: reduce the surface")
    # A volume mesh may list its faces, edges and points too: at most a few for every element.
    elif counted > 4 * max(elements_max, 1000):
        raise too_many(path, f"has {counted} cells", elements_max)


def _surface(path: Path) -> RawMesh:
    import trimesh

    try:
        surface: Any = trimesh.load(path, force="mesh", process=False)
        nodes, cells = np.asarray(surface.vertices, dtype=float), np.asarray(surface.faces, dtype=np.int64)
    except Exception as error:  # the readers of trimesh pass on the exceptions of many libraries
        raise MeshError(f"{path}: cannot be read as a surface: its content is not what '{path.suffix}' stands for") from error
    if len(cells) == 0:
        raise MeshError(f"{path}: has no triangles")
    return RawMesh("tri3", nodes, cells)


def _mesh(path: Path) -> RawMesh:
    import meshio

    try:
        # meshio prints its warnings.
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            content = meshio.read(path)
    except SystemExit as error:  # where none of its readers reads the file, it prints so and asks to exit
        raise MeshError(f"{path}: cannot be read as a mesh: its content is not what '{path.suffix}' stands for") from error
    except Exception as error:  # its readers pass on what fails in them
        raise MeshError(f"{path}: cannot be read as a mesh: {error or type(error).__name__}") from error
    nodes = np.asarray(content.points, dtype=float)
    if nodes.ndim != 2 or nodes.shape[1] != 3:
        raise MeshError(f"{path}: its points have {nodes.shape[-1]} coordinates; 3 are needed")
    types = sorted({block.type for block in content.cells})
    solid = [name for name in types if name not in _SUPPORT]
    unknown = [name for name in solid if name not in _VOLUMES]
    if unknown or len({_VOLUMES[name] for name in solid}) > 1:
        raise MeshError(f"{path}: has cells of {', '.join(solid)}; one kind is needed, of {', '.join(_VOLUMES)}")
    if solid:
        kind, count = _VOLUMES[solid[0]]
        cells = np.vstack([block.data[:, :count] for block in content.cells if block.type in solid]).astype(np.int64)
        return RawMesh(kind, nodes, cells)
    triangles = [_triangles(block.data[:, : _SURFACES[block.type]]) for block in content.cells if block.type in _SURFACES]
    if not triangles:
        raise MeshError(f"{path}: has {'cells of ' + ', '.join(types) if types else 'no cells'}; a volume or a surface is needed")
    return RawMesh("tri3", nodes, np.vstack(triangles).astype(np.int64))


def _triangles(faces: np.ndarray) -> np.ndarray:
    return faces if faces.shape[1] == 3 else np.vstack([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
