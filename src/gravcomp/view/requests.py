"""The user's requests on the page, as data; the program that serves the page executes them."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class SetTarget:
    """Set a bend as target: angle (rad) between base and tip direction, plane (rad) about z from x."""

    angle: float
    plane: float


@dataclasses.dataclass(frozen=True)
class TiltBase:
    """Tilt the virtual robot's base: inclination above the horizontal and roll about the robot's axis, rad."""

    inclination: float
    roll: float


@dataclasses.dataclass(frozen=True)
class Compensate:
    """'compensate': send commands; 'hold': send none, the motors hold; 'relax': pay the cables out."""

    mode: str


@dataclasses.dataclass(frozen=True)
class InjectFault:
    """Inject a fault, given as YAML of `gravcomp.virtual.faults`, into the virtual robot; 'clear' ends all faults."""

    text: str


@dataclasses.dataclass(frozen=True)
class BridgeService:
    """Call a service of the bridge: 'home', 'stop' or 'release'."""

    name: str


@dataclasses.dataclass(frozen=True)
class Record:
    """Start or stop recording a bag."""

    on: bool


Request = SetTarget | TiltBase | Compensate | InjectFault | BridgeService | Record
