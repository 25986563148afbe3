"""Meshes as they come from other programmes: reading, repairing, unit, axis and place of a body in a file.

    file -> `formats` -> `repair_volume` or `repair_surface` -> `orientation` -> `centreline` -> `units` -> body in soft_base

`placing` takes the steps one after the other. A surface is filled with tetrahedra by `filling`.
"""

from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.placing import PlacedBody, Placement, placed_body

__all__ = ["MeshError", "PlacedBody", "Placement", "placed_body"]
