"""Weights hung from points of the body."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class PointLoad:
    """A weight hung from a point of the body: gravity acts on its mass there, and the point carries its inertia."""

    at: tuple[float, float, float] = parameter(
        edge="mm", minimum=-5000.0, maximum=5000.0, description="point of the body at rest, in soft_base"
    )
    mass: float = parameter(edge="g", minimum=0.0, maximum=1e5, description="mass of the weight")
