"""The division of segments into elements that reaches an accuracy at the least cost.

The error of a mesh is the distance of its tip from that of a mesh twice as fine along, around and through the wall, under the
loads of `mesh_loads`. It is estimated on coarse meshes: each direction alone is refined, the others staying as coarse as can be,
its change of the tip is scaled to twice the number of elements by the power with which it falls (L. F. Richardson, 1911), and the
changes are added up. The direction that loses most error for each unknown it adds is refined, until the sum is within `ACCURACY`.

The choice is kept in the cache, by content. Young's moduli enter rounded down to steps of 19 %, so that a calibrated robot mostly
has the mesh of the robot from which it was calibrated. `mesh_error` measures what is only estimated here.
"""

import dataclasses
import json
import logging
import math

import numpy as np

from gravcomp.cache import cache_path, content_key
from gravcomp.description import Elements, Material, Robot
from gravcomp.full_model.flat_elements import with_grading
from gravcomp.mesh.mesh import MeshError
from gravcomp.mesh.pieces import pieces_of
from gravcomp.mesh.refusal import well_shaped
from gravcomp.mesh.tube import coarse_elements, tube_mesh

ACCURACY = 1e-3
"""Error of the tip that a mesh may have, over the length."""

_FORMAT = 3  # part of the key; to be raised when the choice changes
# The part of `ACCURACY` that the estimate may use.
_USED = 0.9
# The power of the number of elements with which the change of a direction falls.
_ORDER = {"along": 1.5, "around": 2.0, "radial": 1.0}
_START_ALONG = 8
_MOST_UNKNOWNS = 15000
# A load that a finer mesh does not carry is made smaller by this factor, so often.
_LESS, _TIMES = 0.7, 4


@dataclasses.dataclass(frozen=True)
class MeshChoice:
    """A division; error: estimate of the tip's error over the length."""

    elements: Elements
    error: float


def with_chosen_elements(robot: Robot) -> Robot:
    """Return the robot with chosen elements, where it consists of segments and its file gives none. Raises MeshError."""
    if robot.body is not None or robot.elements is not None:
        return robot
    return dataclasses.replace(robot, elements=chosen_mesh(robot).elements)


def chosen_mesh(robot: Robot) -> MeshChoice:
    """Return the choice for a robot of segments, whatever its `elements` are. Raises MeshError if it cannot be meshed."""
    rounded = _rounded(robot)
    path = cache_path("mesh", content_key(_FORMAT, rounded), ".json")
    if path.exists():
        stored = json.loads(path.read_text())
        return MeshChoice(Elements(**stored["elements"]), stored["error"])
    choice = _choose(rounded)
    if choice.error > ACCURACY:
        logging.getLogger(__name__).warning(
            "the mesh chosen for '%s' leaves an estimated error of %.2g %% of the length; wanted: %g %%",
            robot.name,
            100 * choice.error,
            100 * ACCURACY,
        )
    part = path.with_suffix(".part")
    part.write_text(json.dumps(dataclasses.asdict(choice)))
    part.replace(path)
    return choice


def _rounded(robot: Robot) -> Robot:
    """The robot with what does not matter for the mesh removed, and Young's moduli rounded."""

    def material(m: Material) -> Material:
        return dataclasses.replace(
            m,
            youngs_modulus=_rounded_down(m.youngs_modulus),
            damping_time=0.0,
            creep_ratio=0.0,
            creep_time=0.5,
            prony=(),
        )

    segments = tuple(
        dataclasses.replace(
            s, material=material(s.material), cap=s.cap and dataclasses.replace(s.cap, material=material(s.cap.material))
        )
        for s in robot.segments
    )
    cables = tuple(c.without_line() for c in robot.cables)
    return Robot("chosen", segments=segments, cables=cables, limits=robot.limits, payload=robot.payload, loads=robot.loads)


def _rounded_down(modulus: float) -> float:
    """The next lower step of four to an octave."""
    return 2.0 ** (math.floor(4.0 * math.log2(modulus)) / 4.0)


def _choose(robot: Robot) -> MeshChoice:
    tips = _Tips(robot)
    start = here = _start(robot)
    tips.prepare(start)
    changes: dict[str, np.ndarray] = {}  # of the tips (l, 3) over the length, from this mesh to one twice as fine in a direction
    while True:
        gains = {}
        for direction in _ORDER:
            finer = _finer(robot, here, direction)
            if finer == here or tips.unknowns(finer) > _MOST_UNKNOWNS:
                continue
            if direction not in changes:
                changes[direction] = _change_to_twice(robot, tips, start, direction, getattr(here, direction))
            gains[direction] = _largest(changes[direction]) / (tips.unknowns(finer) - tips.unknowns(here))
        error = _together(list(changes.values())) if changes else 0.0
        if error <= _USED * ACCURACY or not gains:
            return MeshChoice(here, error)
        best = max(gains, key=lambda direction: gains[direction])
        here = _finer(robot, here, best)
        del changes[best]


def _change_to_twice(robot: Robot, tips: "_Tips", start: Elements, direction: str, number: int) -> np.ndarray:
    """The change of the tips (l, 3) over the length from `number` of elements in a direction to twice as many.

    Along the robot it is measured. A finer section costs much, so that its change is measured on the first mesh only.
    """
    order = _ORDER[direction]
    measured = number if direction == "along" else getattr(start, direction)
    finer = getattr(_finer(robot, _with(robot, start, direction, measured), direction), direction)
    change = tips.change(*(_with(robot, start, direction, value) for value in (measured, finer)))
    return change * (1.0 - 0.5**order) / (1.0 - (measured / finer) ** order) * (measured / number) ** order


def _together(changes: list[np.ndarray]) -> float:
    """The size of changes (l, 3) that act together; where they cancel out, that of independent ones."""
    return max(_largest(np.sum(changes, axis=0)), math.sqrt(sum(_largest(change) ** 2 for change in changes)))


def _largest(changes: np.ndarray) -> float:
    """The largest of the distances (l, 3); a load without equilibrium (NaN) does not count."""
    distances = np.linalg.norm(changes, axis=1)
    return float(np.nanmax(distances)) if not np.isnan(distances).all() else 0.0


class _Tips:
    """The tips of a robot's meshes under its loads, each computed once."""

    def __init__(self, robot: Robot):
        self._robot = robot
        self._known: dict[Elements, np.ndarray] = {}
        self._unknowns: dict[Elements, int] = {}

    def prepare(self, elements: Elements) -> None:
        """Find the loads with a mesh."""
        from gravcomp.full_model.mesh_loads import mesh_loads

        self._loads = mesh_loads(self._model(elements))

    def unknowns(self, elements: Elements) -> int:
        """Return the number of unknowns of a mesh."""
        if elements not in self._unknowns:
            self._unknowns[elements] = 3 * len(tube_mesh(dataclasses.replace(self._robot, elements=elements)).nodes)
        return self._unknowns[elements]

    def change(self, one: Elements, other: Elements) -> np.ndarray:
        """Return the change of the tips (l, 3) from one mesh to another, over the length."""
        for _ in range(_TIMES):
            change = (self._tips(other) - self._tips(one)) / self._robot.length
            if not np.isnan(change).any():
                break
            self._known.clear()
            self._loads = [dataclasses.replace(load, tension=_LESS * load.tension) for load in self._loads]
        return change

    def _tips(self, elements: Elements) -> np.ndarray:
        from gravcomp.full_model.mesh_loads import tips_under

        if elements not in self._known:
            self._known[elements] = tips_under(self._model(elements), self._loads)
        return self._known[elements]

    def _model(self, elements: Elements):  # type: ignore[no-untyped-def]
        from gravcomp.full_model.model import RobotModel

        return RobotModel(dataclasses.replace(self._robot, elements=elements))


def _start(robot: Robot) -> Elements:
    """Coarse numbers whose elements are well shaped."""
    parts = sum(len(piece.marks) + 1 for piece in pieces_of(robot))
    disks = any(segment.disks for segment in robot.segments)
    around = 4 if coarse_elements(robot).around == 8 else 6
    along = parts if disks else max(_START_ALONG, parts)
    # Between disks the layers are even; else they are graded towards the clamp, whose corner is singular.
    start = Elements(around=around, along=along, radial=1, grading=1.0, equal_stiffness=True)
    shaped = well_shaped(robot, start)
    if shaped is None:
        raise MeshError(
            f"robot '{robot.name}': no mesh of its segments has elements of a good shape; its walls are too thin or too steep"
        )
    return shaped if disks else with_grading(robot, shaped)


def _finer(robot: Robot, elements: Elements, direction: str) -> Elements:
    """The next numbers in a direction; the same where there are none."""
    if direction == "around":
        return _with(robot, elements, "around", min(elements.around + (4 if elements.around % 4 == 0 else 2), 48))
    if direction == "radial":
        return _with(robot, elements, "radial", min(elements.radial + 1, 8))
    parts = sum(len(piece.marks) + 1 for piece in pieces_of(robot))
    disks = any(segment.disks for segment in robot.segments)
    return _with(robot, elements, "along", min(elements.along + parts if disks else math.ceil(1.4 * elements.along), 500))


def _with(robot: Robot, elements: Elements, direction: str, number: int) -> Elements:
    """The elements with another number in a direction, and the grading that suits it."""
    changed = Elements(**(dataclasses.asdict(elements) | {direction: number}))
    return changed if any(segment.disks for segment in robot.segments) else with_grading(robot, changed)
