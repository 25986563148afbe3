"""A body from a mesh file, and how it is put into `soft_base`."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.description.body import Material
from gravcomp.mesh_files import PlacedBody, Placement, placed_body
from gravcomp.mesh_files.units import LENGTHS


@dataclasses.dataclass(frozen=True)
class Transform:
    """Puts the file's body into soft_base: scaled, then rotated, then moved."""

    scale: float = parameter(1.0, minimum=1e-6, maximum=1e6, description="factor on the size of the body")
    rotate: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0),
        edge="deg",
        minimum=-360.0,
        maximum=360.0,
        description="angles about the fixed axes x, y and z, in this order",
    )
    move: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), edge="mm", minimum=-1e5, maximum=1e5, description="displacement after the rotation"
    )


@dataclasses.dataclass(frozen=True)
class MeshBody:
    """A body from a file: a closed surface, which is filled with elements, or a volume mesh; `mesh_files` reads the formats."""

    file: str = parameter(description="path of the mesh, relative to the robot file")
    length: float | None = parameter(
        None,
        edge="mm",
        minimum=1e3 * LENGTHS[0],
        maximum=1e3 * LENGTHS[1],
        description="length along the axis, settles the unit; that of the file if not given",
    )
    file_unit: float | None = parameter(
        None, edge="mm", minimum=1e-6, maximum=1e6, description="length of one unit of the file; found from the size if not given"
    )
    axis: str = parameter(
        "given",
        choices=("given", "auto", "auto_reversed"),
        description="the file's z after the transform, or found from the body's shape; reversed: base and tip exchanged",
    )
    transform: Transform = parameter(default_factory=Transform, description="scale, rotation and displacement, after the axis")
    element_size: float | None = parameter(
        None,
        edge="mm",
        minimum=0.05,
        maximum=500.0,
        description="largest edge length of tetrahedra in a surface, and distance of a cable's via points; chosen if not given",
    )
    elements_max: int = parameter(
        20_000, minimum=1, maximum=2_000_000, description="a mesh with more elements is refused; memory grows with their number"
    )
    remesh: bool = parameter(False, description="make new elements inside the surface of a file that has elements")
    material: Material = parameter(default_factory=Material, description="material of the body")

    @property
    def placement(self) -> Placement:
        """How the body is put into soft_base."""
        put = self.transform
        return Placement(self.axis, self.file_unit, self.length, put.scale, put.rotate, put.move, self.elements_max)

    def placed(self) -> PlacedBody:
        """Return the body in soft_base, read when it is asked for first; to be meshed again, its surface. Raises MeshError."""
        placed = placed_body(self.file, self.placement)
        return placed.without_elements if self.remesh else placed

    @property
    def full_length(self) -> float:
        """Length along the axis (m); without a declared one the file is read. Raises MeshError."""
        return self.placed().length if self.length is None else self.length
