"""Weights of accuracy, effort and smoothness in the inverse problem, and the tolerances of a reached target."""

from dataclasses import dataclass

from gravcomp.config import parameter

_SLACK, _TOLERANCE = 1e-3, 0.04  # of the robot's length


@dataclass(frozen=True)
class InverseOptions:
    """Options of the inverse problem.

    Options without unit are relative to the tip's response to the cables, so they suit any robot.
    """

    axial_weight: float = parameter(
        0.05, minimum=0.0, maximum=1.0,
        description="weight of errors along the robot relative to errors across it: cables pull, so they shorten it",
    )  # fmt: skip
    energy_weight: float = parameter(
        3e-4, minimum=1e-6, maximum=1.0, description="weight of the cables' work; prevents cables that pull against each other"
    )
    proximal_weight: float = parameter(
        0.02, minimum=0.0, maximum=10.0, description="weight of the change of tension in a step; prevents steps that oscillate"
    )
    slack: float | None = parameter(
        None,
        edge="mm",
        minimum=0.0,
        maximum=50.0,
        description="length by which an idle cable is paid out beyond its path, to stay slack; none: 0.1 % of the robot's length",
    )
    pretension: float = parameter(
        0.0, unit="N", minimum=0.0, maximum=5.0, description="smallest tension of every cable; above 0 no cable becomes slack"
    )
    tolerance: float | None = parameter(
        None,
        edge="mm",
        minimum=0.01,
        maximum=1000.0,
        description="largest distance from a reached target, including the shortening by the cables;"
        " none: 4 % of the robot's length",
    )
    tilt_tolerance: float = parameter(
        5.0,
        edge="deg",
        minimum=0.1,
        maximum=90.0,
        description="largest angle to the direction of a reached target, if the direction has a weight",
    )

    max_contact_force: float | None = parameter(
        None,
        unit="N",
        minimum=1e-3,
        maximum=1e3,
        description="largest force with which the cables press the robot on one obstacle of the scene: the sum of the normal"
        " forces there; none: no bound",
    )

    def slack_of(self, length: float) -> float:
        """Return `slack` in m of a robot of `length` m."""
        return _SLACK * length if self.slack is None else self.slack

    def tolerance_of(self, length: float) -> float:
        """Return `tolerance` in m of a robot of `length` m."""
        return _TOLERANCE * length if self.tolerance is None else self.tolerance
