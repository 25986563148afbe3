"""The division of segments, or of a swept body from a file, into elements that reaches an accuracy at the least cost.

The error of a mesh is the distance of its tip from that of a mesh twice as fine along, around and through the wall, under the
loads of `mesh_loads`. It is estimated from small steps: each direction alone is refined a little, its change of the tip is scaled
to twice the number of elements by the power with which it falls (L. F. Richardson, 1911), and the changes are added up. Of the
directions with a large part of the error, the one that loses most of it for the time that it adds to a step is refined, until the
sum is within `ACCURACY`: one with a small part is cheap to refine, but each mesh on the way has to be measured. Where no
direction can be refined any more, or the search has cost as much as it may, the mesh with the least error so far is taken, and a
warning gives its estimate where that is too large. What cannot be measured any more of the last mesh follows from coarser ones.
The first direction is along the robot: under coarse layers the sections seem to be worse than they are, several times so where
the stiffness jumps.

The shapes of a mesh are followed up to the loads once. Those of the next mesh are found from there, see `carried_shape`.

The choice is kept in the cache, by content. Young's moduli enter rounded down to steps of 19 %, so that a calibrated robot mostly
has the mesh of the robot from which it was calibrated. `mesh_error` measures what is only estimated here.
"""

import dataclasses
import json
import logging
import math
from pathlib import Path
from typing import Any

import numpy as np

from gravcomp.cache import cache_path, content_key
from gravcomp.description import Elements, Material, Robot
from gravcomp.full_model.flat_elements import deep_cells, with_grading
from gravcomp.full_model.mesh_loads import TIMES, LoadedShapes, less_tension, mesh_loads, shapes_under
from gravcomp.full_model.model import MeshedModel
from gravcomp.mesh.division import divided_mesh, fewest_elements, pieces_to_divide
from gravcomp.mesh.layers import least_layers, softest
from gravcomp.mesh.mesh import MeshError
from gravcomp.mesh.refusal import is_well_shaped, well_shaped
from gravcomp.whole_file import write_whole

ACCURACY = 1e-3
"""Error of the tip that a mesh may have, over the length."""

_FORMAT = 10  # part of the key; to be raised when the choice changes
# The part of `ACCURACY` that the estimate may use.
_USED = 0.9
# The power of the number of elements with which the change of a direction falls, in the order in which directions are measured.
_ORDER = {"along": 1.0, "around": 1.5, "radial": 1.0}
# The part of the error from which on a direction is refined.
_MATTERS = 0.25
# The sections are measured only where the change along the robot is within this part of `ACCURACY`.
_ALONG_FIRST = 1.0
_START_ALONG = 8
# The power with which layers are denser where the body is soft, and the stiffness over the largest from where on it is used.
_SOFTNESS, _ALIKE = 0.5, 0.7
_MOST_UNKNOWNS = 15000
# The most multiplications in factors that a choice may take, about twenty seconds of one core where shapes are
# found from those of the mesh before, and the factors of a load on one mesh.
_MOST_WORK, _FACTORS = 1e11, 12
# The most cells through the wall, of those around: with more they are flat, and the estimate of both directions is wrong. What
# more cells through the wall change is then measured on the mesh with the next number around.
_FLAT = 0.5


@dataclasses.dataclass(frozen=True)
class MeshChoice:
    """A division; error: estimate of the tip's error over the length."""

    elements: Elements
    error: float


def chosen_mesh(robot: Robot) -> MeshChoice:
    """Return the choice for a robot of segments, or with a body that can be swept, whatever its `elements` are.

    Raises MeshError if it cannot be meshed.
    """
    rounded = _rounded(robot)
    path = place_of_choice(robot)
    if path.exists():
        stored = json.loads(path.read_text(encoding="utf-8"))
        return MeshChoice(Elements(**stored["elements"]), stored["error"])
    choice, left_out = _choose(rounded)
    if left_out:
        logging.getLogger(__name__).warning(
            "the mesh for '%s' is chosen without the load '%s', for which no equilibrium is found",
            robot.name,
            "' and '".join(left_out),
        )
    if choice.error > ACCURACY:
        logging.getLogger(__name__).warning(
            "the mesh chosen for '%s' leaves an estimated error of %.2g %% of the length; wanted: %g %%",
            robot.name,
            100 * choice.error,
            100 * ACCURACY,
        )
    write_whole(path, json.dumps(dataclasses.asdict(choice)))
    return choice


def place_of_choice(robot: Robot) -> Path:
    """Return the file of the choice for a robot in the cache, which may not exist yet. Raises MeshError."""
    return cache_path("mesh", content_key(_FORMAT, *described_for_mesh(_rounded(robot))), ".json")


def described_for_mesh(robot: Robot) -> list[Any]:
    """Return what the mesh of a robot follows from: of a body from a file the body as it is placed, not the file."""
    if robot.body is None:
        return [robot]
    placed = robot.body.placed()
    described = [dataclasses.asdict(placed.axis), dataclasses.asdict(robot.body.material)]
    return [*described, placed.nodes, placed.cells, robot.cables, robot.limits, robot.payload, robot.loads]


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
    body = robot.body and dataclasses.replace(robot.body, material=material(robot.body.material))
    return Robot(
        "chosen", segments=segments, body=body, cables=cables, limits=robot.limits, payload=robot.payload, loads=robot.loads
    )


def _rounded_down(modulus: float) -> float:
    """The next lower step of four to an octave."""
    return 2.0 ** (math.floor(4.0 * math.log2(modulus)) / 4.0)


def _choose(robot: Robot) -> tuple[MeshChoice, list[str]]:
    """Return the choice, and the names of the loads that are left out, as a mesh or a finer one has no equilibrium under them."""
    here = _start(robot)
    tips = _Tips(robot, here)
    choices: list[MeshChoice] = []
    left_out: dict[Elements, list[str]] = {}
    known: dict[str, tuple[int, np.ndarray]] = {}  # of each direction, the last number of elements and change that is measured
    exhausted = False

    def best_choice() -> tuple[MeshChoice, list[str]]:
        best = min(choices, key=lambda choice: choice.error)
        return best, left_out[best.elements]

    while True:
        # Of the tips (l, 3) over the length, from this mesh to one twice as fine in a direction.
        changes: dict[str, np.ndarray] = {}
        lost: dict[str, float] = {}  # error that the next mesh in a direction loses, of that to one twice as fine
        meshes: dict[str, Elements] = {}
        for direction in _ORDER:
            base, finer = here, tips.finer(here, direction)
            if finer is None:
                continue
            flat = direction == "radial" and "around" in changes and finer.radial > _FLAT * finer.around
            if flat and "around" in meshes and (deeper := tips.finer(meshes["around"], direction)) is not None:
                base, finer = meshes["around"], deeper
            number = getattr(base, direction)
            if choices and tips.work + tips.work_of(finer) > _MOST_WORK:
                exhausted = True
                if direction not in known:
                    return best_choice()
                coarser, change = known[direction]
                changes[direction] = (coarser / number) ** _ORDER[direction] * change
                continue
            changes[direction] = _to_twice(number, getattr(finer, direction), direction) * tips.change(base, finer)
            known[direction] = number, changes[direction]
            if base != here:  # more elements around are what allows more cells through the wall: they lose both changes
                lost["around"] = _largest(changes["around"] + changes[direction])
            if flat or tips.unknowns(finer) > _MOST_UNKNOWNS:  # not to be used, but the error has to be known
                continue
            meshes[direction] = finer
            lost[direction] = _largest(changes[direction])
            early = choices or tips.work < 0.5 * _MOST_WORK  # else there would be no estimate in the end
            if direction == "along" and early and _largest(changes[direction]) > _ALONG_FIRST * ACCURACY:
                break
        else:  # all directions are measured
            choices.append(MeshChoice(here, _together(list(changes.values())) if changes else 0.0))
            left_out[here] = tips.left_out(list(changes.values()))
            if choices[-1].error <= _USED * ACCURACY or exhausted or not lost:
                return best_choice()
        matters = [direction for direction in lost if lost[direction] >= _MATTERS * max(lost.values())]
        added = {direction: tips.cost(meshes[direction]) - tips.cost(here) for direction in matters}
        here = _not_deep(robot, meshes[max(matters, key=lambda direction: lost[direction] / added[direction])])


def _to_twice(number: int, finer: int, direction: str) -> float:
    """The change from `number` of elements in a direction to twice as many, over that from `number` to `finer`."""
    order = _ORDER[direction]
    return float((1.0 - 0.5**order) / (1.0 - (number / finer) ** order))


def _together(changes: list[np.ndarray]) -> float:
    """The size of changes (l, 3) that act together; where they cancel out, that of independent ones."""
    return max(_largest(np.sum(changes, axis=0)), math.sqrt(sum(_largest(change) ** 2 for change in changes)))


def _largest(changes: np.ndarray) -> float:
    """The largest of the distances (l, 3); a load without equilibrium (NaN) does not count."""
    distances = np.linalg.norm(changes, axis=1)
    return float(np.nanmax(distances)) if not np.isnan(distances).all() else 0.0


class _Tips:
    """The tips of a robot's meshes under its loads, each computed once; work: of all of them, see `work_of`."""

    def __init__(self, robot: Robot, start: Elements):
        """Find the loads with the mesh `start`."""
        self._robot = robot
        self._known: dict[Elements, LoadedShapes] = {}
        self._unknowns: dict[Elements, int] = {}
        self.work = 0.0
        self._loads = mesh_loads(self._model(start))

    def unknowns(self, elements: Elements) -> int:
        """Return the number of unknowns of a mesh."""
        if elements not in self._unknowns:
            self._unknowns[elements] = 3 * len(divided_mesh(self._robot, elements).nodes)
        return self._unknowns[elements]

    def cost(self, elements: Elements) -> float:
        """Return a measure of the time of a step: unknowns times the square of those of a layer, as for a band's factor."""
        return self.unknowns(elements) ** 3 / elements.along**2

    def work_of(self, elements: Elements) -> float:
        """Return about how many multiplications the factors of a mesh take; none where its tips are known."""
        return 0.0 if elements in self._known else _FACTORS * len(self._loads) * self.cost(elements)

    def finer(self, elements: Elements, direction: str) -> Elements | None:
        """Return the next mesh in a direction that has more unknowns and a good shape; None where there is none."""
        here = elements
        while (finer := _finer(self._robot, here, direction)) != here:
            if self.unknowns(finer) > self.unknowns(elements):
                return finer if is_well_shaped(self._robot, finer) else None
            here = finer
        return None

    def change(self, one: Elements, other: Elements) -> np.ndarray:
        """Return the change of the tips (l, 3) from one mesh to another, over the length."""
        for _ in range(TIMES):
            change = (self._tips(other, one) - self._tips(one)) / self._robot.length
            lost = np.isnan(change).any(axis=1)
            if not any(load.tension.any() for load, without in zip(self._loads, lost) if without):
                break  # less tension does not help
            self._known.clear()
            self._loads = less_tension(self._loads)
        return change

    def left_out(self, changes: list[np.ndarray]) -> list[str]:
        """Return the names of the loads without equilibrium, whose entries in the changes (l, 3) are NaN."""
        if not changes:
            return []
        lost = np.atleast_1d(np.isnan(changes).any(axis=(0, 2)))
        return [load.name for load, without in zip(self._loads, lost) if without]

    def _tips(self, elements: Elements, near: Elements | None = None) -> np.ndarray:
        """The tips (l, 3) in m; near: a mesh that is nearly the same."""
        if elements not in self._known:
            if near is not None:
                self._tips(near)
            self.work += self.work_of(elements)
            self._known[elements] = shapes_under(self._model(elements), self._loads, self._known[near] if near else None)
        return self._known[elements].tips

    def _model(self, elements: Elements) -> MeshedModel:
        return MeshedModel(dataclasses.replace(self._robot, elements=elements))


def _start(robot: Robot) -> Elements:
    """Coarse numbers whose elements are well shaped."""
    parts = least_layers(pieces_to_divide(robot))
    disks = any(segment.disks for segment in robot.segments)
    around = 4 if fewest_elements(robot).around == 8 else 6
    along = parts if disks else max(_START_ALONG, parts)
    # Between disks the layers are even; else they are graded towards the clamp, whose corner is singular.
    start = Elements(
        around=around, along=along, radial=1, grading=1.0, equal_stiffness=True, softness=0.0 if disks else _softness(robot)
    )
    shaped = well_shaped(robot, start)
    if shaped is None:
        raise MeshError(
            f"robot '{robot.name}': no mesh of its segments has elements of a good shape; its walls are too thin or too steep"
        )
    return _not_deep(robot, shaped if disks else _graded(robot, shaped))


def _graded(robot: Robot, elements: Elements) -> Elements:
    """The well-shaped elements with the grading that suits them, where needed more along the robot; else without it."""
    for more in (1.0, 1.5, 2.0, 3.0):
        graded = with_grading(robot, dataclasses.replace(elements, along=min(round(more * elements.along), 500)))
        if is_well_shaped(robot, graded):
            return graded
    return elements


def _softness(robot: Robot) -> float:
    """The power with which layers are denser where the body is soft: none where the layers would hardly move."""
    return _SOFTNESS if softest(pieces_to_divide(robot)) < _ALIKE else 0.0


def _not_deep(robot: Robot, elements: Elements) -> Elements:
    """The elements with as many cells through the wall as the next number around needs."""
    while elements.radial < 8 and deep_cells(robot, _finer(robot, elements, "around")):
        elements = _finer(robot, elements, "radial")
    return elements


def _finer(robot: Robot, elements: Elements, direction: str) -> Elements:
    """The next numbers in a direction; the same where there are none."""
    if direction == "around":
        return _with(robot, elements, "around", min(elements.around + (4 if elements.around % 4 == 0 else 2), 48))
    if direction == "radial":
        return _with(robot, elements, "radial", min(elements.radial + 1, 8))
    parts = least_layers(pieces_to_divide(robot))
    disks = any(segment.disks for segment in robot.segments)
    return _with(robot, elements, "along", min(elements.along + parts if disks else math.ceil(1.4 * elements.along), 500))


def _with(robot: Robot, elements: Elements, direction: str, number: int) -> Elements:
    """The elements with another number in a direction, and the grading that suits it."""
    changed = Elements(**(dataclasses.asdict(elements) | {direction: number}))
    return changed if any(segment.disks for segment in robot.segments) else with_grading(robot, changed)
