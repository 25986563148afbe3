"""What is around a robot, as bounds of a step's programme: zones that are forbidden to it, and the force on obstacles.

    zone:      gap + gap' . (lambda - lambda_now) >= a thousandth of the robot's length
    obstacle:  force + force' . (lambda - lambda_now) <= max_contact_force
    approach:  gap + gap' . (lambda - lambda_now) >= - a thousandth of the robot's length, with a bound on the force

gap' is that of `clearance`; force' comes with the shape (`contact.contacts`), whose contact goes on touching. An obstacle that is
not touched yet has no force', so that a step may enter it only a little: the next one knows the force. All rows are those of the
linear response at the present shape, like the rest of the programme, and become exact as the steps become small.
"""

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.contact.contacts import ObstacleForces, in_mm
from gravcomp.contact.start import refuse_start
from gravcomp.contact.surface import contact_surface
from gravcomp.description import Robot
from gravcomp.inverse.clearance import Nearby, nearby
from gravcomp.inverse.scaling import NO_ROWS, TensionRows
from gravcomp.scene.scene import Scene

if TYPE_CHECKING:
    from gravcomp.full_model.shape import Response

_DISTANCE = 1e-3  # of the robot's length: from a zone, and into an obstacle that is not touched yet
_WITHIN = 0.1  # of the robot's length: farther places do not come into a zone in one step
_PLACES = 12  # next to zones, and as many next to obstacles
_BLOCK = 8  # the programme has a multiple of so many rows, because a solver starts cold where their number changes
_REACHED = 1e-5  # of the robot's length, and of the largest force: a bound that is met


@dataclasses.dataclass(frozen=True)
class Demands:
    """Bounds of one step, and what they are about.

    rows: r forces, then z places next to zones, then others; forces; near: the places, with the names (z) of their zones.
    """

    rows: TensionRows
    forces: ObstacleForces
    largest_force: float
    near: Nearby
    names: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Met:
    """What a step meets, in words; empty: nothing. entered and pressed: a zone or a force that could not be kept."""

    zone: str = ""
    entered: str = ""
    force: str = ""
    pressed: str = ""

    @property
    def holds(self) -> bool:
        """Whether it keeps the robot from its target."""
        return bool(self.zone or self.entered or self.force or self.pressed)


NOTHING = Met()


class Surroundings:
    """Obstacles and zones around one robot. Attribute scene: the obstacles, if any."""

    def __init__(self, robot: Robot, scene: Scene | None, zones: Scene | None):
        """Raise ConfigError for a robot that has no outlines along its axis, or whose base is inside a zone or an obstacle."""
        self._length, self.scene, self._zones = robot.length, scene or None, zones or None
        self._strongest = robot.limits.tension_max
        for around in (self._zones, self.scene):
            if around is not None:
                try:
                    surface = contact_surface(robot)
                    refuse_start(around, robot)
                except ConfigError:
                    raise
                except ValueError as error:
                    raise ConfigError(f"{around.source}: scene: {error}") from error
                self._surface = surface._replace(outline=np.zeros((len(surface.place), 0, 2)))

    def demands(
        self,
        response: "Response",
        tension: np.ndarray,
        station: np.ndarray,
        gravity: np.ndarray | None,
        forces: ObstacleForces,
        largest_force: float | None,
    ) -> Demands | None:
        """Return the bounds of the next step; None: nothing is near.

        tension (m,) in N: present ones; station (n,): of the response's backbone; gravity (3,) in m/s^2 places what is in the
        world, None: the horizontal robot; largest_force in N on one obstacle, None: any.
        """
        blocks: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        if largest_force is not None and len(forces):
            present = forces.change @ tension
            blocks.append((forces.change, np.full(len(forces), -np.inf), largest_force - forces.force + present))
        margin, near, names = _DISTANCE * self._length, _NOWHERE, ()
        if self._zones is not None:
            near = self._nearby(self._zones, response, tension, station, gravity)
            names = tuple(self._zones.names[self._zones.arrays.obstacle[row]] for row in near.row)
            blocks.append((near.change, margin - near.gap + near.change @ tension, np.full(len(near.gap), np.inf)))
        if largest_force is not None and self.scene is not None:
            wall = self._nearby(self.scene, response, tension, station, gravity)
            least = np.minimum(-margin, wall.gap)
            arrays = self.scene.arrays
            touched = np.array([self.scene.names[k] in forces.names for k in arrays.obstacle[wall.row]], dtype=bool)
            # The depth in a compliant obstacle is its force, which has a row of its own.
            least[touched & np.isfinite(arrays.stiffness[wall.row])] = -np.inf
            blocks.append((wall.change, least - wall.gap + wall.change @ tension, np.full(len(wall.gap), np.inf)))
        count = sum(len(least) for _, least, _ in blocks)
        if not count:
            return None
        rows = np.zeros((-(-count // _BLOCK) * _BLOCK, len(tension)))
        lower, upper = np.full(len(rows), -np.inf), np.full(len(rows), np.inf)
        rows[:count] = np.vstack([block for block, _, _ in blocks])
        lower[:count] = np.concatenate([least for _, least, _ in blocks])
        upper[:count] = np.concatenate([most for _, _, most in blocks])
        return Demands(TensionRows(rows, lower, upper), forces, np.inf if largest_force is None else largest_force, near, names)

    def met(self, demands: Demands | None, change: np.ndarray) -> Met:
        """Return what a step meets that changes the tensions by (m,) N."""
        if demands is None:
            return NOTHING
        zone = entered = force = pressed = ""
        near, forces, largest = demands.near, demands.forces, demands.largest_force
        if len(near.gap):
            gap = near.gap + near.change @ change
            k = int(np.argmin(gap))
            if gap[k] < (_DISTANCE + _REACHED) * self._length:
                zone = f"the forbidden zone '{demands.names[k]}' at ({in_mm(near.position[k])}) mm"
            if gap[k] < -_REACHED * self._length:
                zone, entered = "", f"the robot is {-1e3 * gap[k]:.2f} mm inside {zone}"
        if len(forces) and np.isfinite(largest):
            after = forces.force + forces.change @ change
            k = int(np.argmax(after))
            bound = f"max_contact_force is {largest:g} N"
            if after[k] > largest * (1.0 + 1e-2):
                pressed = f"the force on '{forces.names[k]}' at ({in_mm(forces.position[k])}) mm is {after[k]:.3g} N; {bound}"
            elif after[k] > largest * (1.0 - _REACHED):
                force = f"the force on '{forces.names[k]}' is held; {bound}"
        return Met(zone, entered, force, pressed)

    def _nearby(
        self, scene: Scene, response: "Response", tension: np.ndarray, station: np.ndarray, gravity: np.ndarray | None
    ) -> Nearby:
        """Return the places near the walls of a scene, without those next to the base that no tension moves."""
        moved = response.compliance_ea[6:].reshape(len(station), 3, -1)
        points = (response.compliance_ea[6:] @ tension + response.effector_free[6:]).reshape(-1, 3)
        node = np.asarray(station, dtype=float) * self._length
        if not len(node) or node[-1] < self._length:
            tip = response.compliance_ea[:3]
            node, points = np.append(node, self._length), np.vstack([points, tip @ tension + response.effector_free[:3]])
            moved = np.concatenate([moved, tip[None]])
        if node[0] > 0.0:
            node, points = np.insert(node, 0, 0.0), np.vstack([np.zeros(3), points])
            moved = np.concatenate([np.zeros_like(moved[:1]), moved])
        arrays = scene.arrays if gravity is None else scene.under_gravity(gravity)
        found: Nearby = nearby(
            arrays,
            self._surface,
            node,
            np.ascontiguousarray(points),
            np.ascontiguousarray(moved),
            _WITHIN * self._length,
            _PLACES,
        )
        moves = self._strongest * np.abs(found.change).sum(axis=1) > _DISTANCE * self._length
        return Nearby(*(part[moves] for part in found))


_NOWHERE = Nearby(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 0)), np.zeros((0, 3)))


def rows_of(demands: Demands | None) -> TensionRows:
    """Return the rows for the programme."""
    return NO_ROWS if demands is None else demands.rows
