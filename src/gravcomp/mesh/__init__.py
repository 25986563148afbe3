"""Finite-element meshes of a robot's body: graded hexahedra for tubes, or from a file."""

from gravcomp.mesh.body import body_mesh
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.tube import tube_mesh

__all__ = ["Mesh", "MeshError", "body_mesh", "tube_mesh"]
