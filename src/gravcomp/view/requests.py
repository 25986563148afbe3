"""The user's requests on the page, as data; the program that serves the page executes them."""

import dataclasses
import math

MODES = ("compensate", "hold", "relax")
SERVICES = ("home", "stop", "release")  # of the bridge, each a Trigger

Triple = tuple[float, float, float]


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


@dataclasses.dataclass(frozen=True)
class Push:
    """Pull the virtual robot's tip by a spring to a place (3) in soft_base, m, or let go: None."""

    place: Triple | None


@dataclasses.dataclass(frozen=True)
class PlaceWall:
    """Put a wall next to the virtual robot, by a point (m) and a normal in soft_base, or take it away: None."""

    plane: tuple[Triple, Triple] | None


Request = SetTarget | TiltBase | Compensate | InjectFault | BridgeService | Record | Push | PlaceWall

_FARTHEST = 10.0  # lengths of the robot


def objection(request: Request, length: float) -> str:
    """Return why a request cannot be carried out for a robot of `length` (m); empty if it can.

    What a browser sends need not come from this page.
    """
    match request:
        case SetTarget(first, second) | TiltBase(first, second):
            if not (math.isfinite(first) and math.isfinite(second)):
                return f"angles of {first:g} and {second:g} rad are asked for; finite ones are needed"
        case Compensate(wanted) if wanted not in MODES:
            return f"'{wanted}' is asked of the cables; allowed: {', '.join(MODES)}"
        case BridgeService(wanted) if wanted not in SERVICES:
            return f"'{wanted}' is asked of the motors; allowed: {', '.join(SERVICES)}"
        case Push((_, _, _) as place):
            return _far(place, length, "the hand")
        case PlaceWall((point, normal)):
            size = math.hypot(*normal)
            if not (math.isfinite(size) and size > 0.0):
                return f"the wall's normal is {normal}; a finite vector other than zero is needed"
            return _far(point, length, "the wall")
    return ""


def _far(place: Triple, length: float, what: str) -> str:
    distance = math.hypot(*place)
    if math.isfinite(distance) and distance <= _FARTHEST * length:
        return ""
    return f"{what} is {1e3 * distance:.4g} mm away from the robot's base; allowed: up to {1e3 * _FARTHEST * length:g} mm"
