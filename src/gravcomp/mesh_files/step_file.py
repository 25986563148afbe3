"""Reading the solid in a STEP file: Gmsh's OpenCASCADE gives its surface as triangles, in mm."""

from pathlib import Path

import numpy as np

from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.gmsh_library import TRIANGLE, gmsh_session, mesh_of
from gravcomp.mesh_files.raw_mesh import RawMesh

# Triangles around a full circle, and along the diagonal.
_AROUND, _ALONG = 36, 60


def read_step(path: Path) -> RawMesh:
    """Return the surface of the solid in the file, in mm. Raises MeshError if Gmsh is missing or cannot read it."""
    with gmsh_session(str(path), "cannot read the file") as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.model.occ.importShapes(str(path))
        gmsh.model.occ.synchronize()
        solids = gmsh.model.getEntities(3)
        if len(solids) != 1:
            raise MeshError(f"{path}: has {len(solids)} solids; one body is needed")
        box = np.array(gmsh.model.getBoundingBox(*solids[0]))
        gmsh.option.setNumber("Mesh.MeshSizeMax", float(np.linalg.norm(box[3:] - box[:3])) / _ALONG)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", _AROUND)
        gmsh.model.mesh.generate(2)
        nodes, triangles = mesh_of(gmsh, TRIANGLE, 3)
    return RawMesh("tri3", nodes, triangles, unit=1e-3)
