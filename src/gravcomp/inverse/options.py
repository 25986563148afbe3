"""How the inverse problem weighs exactness against effort and smoothness, and what it calls reached."""

from dataclasses import dataclass

from gravcomp.config import parameter


@dataclass(frozen=True)
class InverseOptions:
    """Options of the inverse problem; those without unit are relative to the tip's answer to the cables, so they suit
    any robot.
    """

    axial_weight: float = parameter(
        0.05, minimum=0.0, maximum=1.0,
        description="weight of errors along the robot, relative to those across it: cables only pull, so they shorten it",
    )  # fmt: skip
    energy_weight: float = parameter(
        3e-4, minimum=1e-6, maximum=1.0, description="weight of the cables' work; keeps them from pulling against each other"
    )
    proximal_weight: float = parameter(
        0.02, minimum=0.0, maximum=10.0, description="weight of the change of tension in a step; keeps the steps from cycling"
    )
    slack: float = parameter(
        0.1, edge="mm", minimum=0.0, maximum=5.0, description="how far an idle cable is paid out beyond its path, to stay slack"
    )
    pretension: float = parameter(
        0.0, unit="N", minimum=0.0, maximum=5.0, description="least tension of every cable; above 0 no cable ever goes slack"
    )
    tolerance: float = parameter(
        4.0,
        edge="mm",
        minimum=0.01,
        maximum=100.0,
        description="distance from the target up to which it counts as kept, the cables' shortening included",
    )
    tilt_tolerance: float = parameter(
        5.0,
        edge="deg",
        minimum=0.1,
        maximum=90.0,
        description="angle from the target's direction up to which it counts as kept, where it has a weight",
    )
