"""Hexahedra of a body from a file: the divided section swept along its axis, with every level of nodes on the body's surface."""

import numpy as np

from gravcomp.description import Elements, MeshBody
from gravcomp.mesh.layered_cells import halved, layered_cells
from gravcomp.mesh.layers import layers_of
from gravcomp.mesh.levels import Levels
from gravcomp.mesh.mesh import Mesh
from gravcomp.mesh.section_grid import section_grid
from gravcomp.mesh.swept_sections import swept_sections


def swept_mesh(body: MeshBody, elements: Elements) -> Mesh:
    """Return the mesh. Raises MeshError for a body that cannot be swept, and numbers of elements that cannot be met."""
    sections = swept_sections(body)
    heights, _ = layers_of([sections], elements.along, elements.grading, elements.first_layer, elements.softness)
    height = halved(heights)
    curves = list(zip(*(sections.curves(s) for s in height)))
    span = (0 if len(curves) == 2 else -1, len(curves) - 1)
    levels = Levels(curves, [span] * (len(height) - 1))
    grid = section_grid(levels, elements.around, elements.radial, elements.equal_stiffness)
    found = layered_cells("hex20", grid.cells, [grid.present[0]] * elements.along)
    straight = np.column_stack([grid.place[found.level, found.planar], height[found.level]])
    axis = sections.placed.axis
    region = np.zeros(len(found.elements), dtype=np.int64)
    return Mesh(
        "hex20", axis.points(straight), found.elements, region, (body.material,), sections.length, height, axis,
        straight if axis.bent else None, in_layers=True,
    )  # fmt: skip
