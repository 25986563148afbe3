"""Options of the question whether a robot can be held."""

from dataclasses import dataclass

from gravcomp.config import parameter


@dataclass(frozen=True)
class HoldOptions:
    """Options without unit are relative to the robot or to its load, so they suit any robot."""

    tolerance: float = parameter(
        0.005,
        minimum=1e-5,
        maximum=0.2,
        description="largest lateral error of a tip that counts as held, over the robot's length",
    )
    equator: int = parameter(
        12, minimum=4, maximum=180, description="directions of gravity around the axis of the robot on the equator of the sphere"
    )
    beyond: float = parameter(
        10.0, minimum=1.0, maximum=1000.0, description="factor of the limits up to which is searched for what would be needed"
    )
    overload: float = parameter(
        4.0,
        minimum=1.0,
        maximum=100.0,
        description="factor of gravity up to which the load is raised to find where the robot buckles",
    )
    first_step: float = parameter(0.25, minimum=0.001, maximum=1.0, description="first step of the load, over gravity")
    least_step: float = parameter(
        0.02, minimum=0.0005, maximum=0.25, description="step of the load, over gravity, below which the path counts as ended"
    )
