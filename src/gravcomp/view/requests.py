"""What a person asks for on the page, as data; who serves the page carries it out."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class SetTarget:
    """A bend to keep: angle (rad) into the plane (rad, about z from x)."""

    angle: float
    plane: float


@dataclasses.dataclass(frozen=True)
class TiltBase:
    """Where the virtual robot's base shall turn to: inclination above the horizontal and roll about the robot's axis, rad."""

    inclination: float
    roll: float


@dataclasses.dataclass(frozen=True)
class Compensate:
    """'compensate': send commands; 'hold': send none, the motors hold; 'relax': pay the cables out."""

    mode: str


@dataclasses.dataclass(frozen=True)
class InjectFault:
    """A fault for the virtual robot, in the words of `gravcomp.virtual.faults`; 'clear' ends all."""

    text: str


@dataclasses.dataclass(frozen=True)
class BridgeService:
    """A service of can_bridge: 'home', 'stop' or 'release'."""

    name: str


@dataclasses.dataclass(frozen=True)
class Record:
    """Begin or end recording a bag."""

    on: bool


Request = SetTarget | TiltBase | Compensate | InjectFault | BridgeService | Record
