"""Training set of the reduced basis: shapes from closed-loop and free motions of the full model.

Young's moduli that are all `s` times as large are equivalent to gravity and tensions that are `s` times smaller, so the range
of moduli is covered by the magnitude of gravity. Each path turns gravity in random directions. On most paths the inverse
controller keeps the robot straight or bent in a random plane, with and without a weight on the tip's direction, so that the
tensions are those of the closed loop, including its transients. On the other paths the cables are released. A robot that carries
external loads has one on most paths: a force and a moment in a random direction on a random section, mostly the tip's, that grow
and fall along the path up to its `max_wrench`.

A soft robot loses its equilibrium on some paths. The turn of gravity and the way of the cables are then halved, from where there
was one; a path on which that does not help is at its end, as a search from the straight robot takes longer than all steps of a
path. Gravity waits while the cables do not yet keep the tip near its target: what the loop reaches in hundreds of small steps has
to be in a path of a few large ones. Where the robot moves far, gravity turns by less in the first place, because a step
that is lost takes as long as four that are not. For the same reason a path whose first shape one search does not find begins with
the hanging robot, and gravity turns from there to the direction that is wanted first. So the path is the search, and a robot that
would sink when it stands upright is held on the way.
"""

import json
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.statics import StaticSolver
from gravcomp.full_model.wrench import Wrench
from gravcomp.inverse import InverseController, direction_weight, rest_target
from gravcomp.simulation.simulator import Simulator

GRAVITY = 9.81
# One step of a path: rotation of gravity, and the time in which the cables may move; after which rotation the axis changes.
# Newton's method takes as many factors for a step of 10 deg as for one of 5, and every second shape of such a path trains as
# good a model as all of them.
_TURN = np.radians(10.0)
_INTERVAL = 0.1
_STRAIGHT_ON = np.radians(70.0)
# How exact the shapes are, over the length: far below what the modes leave.
_TOLERANCE = 1e-5
# Steps in a row without equilibrium that end a path, each half as long as the one before.
_LOST_STEPS = 3
# After a step with an equilibrium the next one is longer by this factor; after one without, half as long.
_GROWING = 1.4
# How far a node should move in a step, over the length: Newton's method loses longer ones, after three times as many factors.
_FARTHEST = 0.07
# Steps in which gravity waits for the cables, where these leave the tip farther than that from its target: a soft robot falls
# faster than winches wind in, and would be trained lying down only.
_MOST_WAITS = 3
# Largest turn of gravity in a step from the direction in which the robot hangs to the one that is wanted first. These steps do
# not count: released robots would hardly leave the directions in which they hang.
_TURN_AT_START = np.radians(30.0)
# Fraction of paths with released cables, and of those that keep the robot straight.
_RELEASED, _STRAIGHT = 0.15, 0.3
# Fraction of paths with an external load, where the robot carries any; and of these, with the load at the tip.
_LOADED, _AT_TIP = 0.7, 0.6


@dataclass(frozen=True)
class TrainingOptions:
    """Random paths: at most `paths`, at least `least`; steps of each; bend: largest in rad; seed.

    modulus_range: relative to the robot's modulus.
    """

    paths: int = 75
    least: int = 25
    steps: int = 15
    modulus_range: tuple[float, float] = (0.6, 1.6)
    bend: float = np.radians(50.0)
    seed: int = 1


# After so many paths it is asked again whether they are enough. Of a robot that turns map onto itself fewer are needed, but these
# at least: they have to contain all kinds of paths.
_NEW = 10
_LEAST_NEW, _LEAST_WITH_IMAGES = 4, 8
_ARRAYS = ("unknowns", "gravity", "tension", "pulling", "load")


@dataclass(frozen=True)
class Sample:
    """An equilibrium of the full model.

    unknowns (3 n_free,) in m; gravity (3,) in m/s^2; tension (m,) in N; pulling (m,): sliding direction of each cable;
    load (7,): external force in N and moment in N m in soft_base, and their station.
    """

    unknowns: np.ndarray
    gravity: np.ndarray
    tension: np.ndarray
    pulling: np.ndarray
    load: np.ndarray


def samples(
    model: RobotModel,
    options: TrainingOptions,
    progress: Callable[[float], None] = lambda share: None,
    kept: Path | None = None,
    enough: Callable[[list[Sample], list[Sample]], bool] | None = None,
    turns: int = 1,
) -> list[Sample]:
    """Return equilibria along random paths. progress: called with the completed share.

    kept: folder in which each path is stored, so that an interrupted run goes on from there and finds the same samples. enough:
    asked every few paths with the samples of earlier paths and those of the last ones, whether they are enough; None: all paths.
    turns: that map the robot onto itself; it is asked after so many fewer paths, as their images are known. Those of a mirror
    are, too, but do not stand for paths: they bend in few other directions.
    """
    rng = np.random.default_rng(options.seed)
    new, least = _NEW, options.least
    if turns > 1:
        new, least = max(_LEAST_NEW, -(-_NEW // turns)), min(least, max(_LEAST_WITH_IMAGES, -(-least // turns)))
    found: list[Sample] = []
    begins: list[int] = []  # of each path, in `found`
    for number in range(options.paths):
        file = None if kept is None else kept / f"{number:04}.npz"
        path = _stored(file, rng) if file else None
        if path is None:
            path = list(_path(model, options, rng))
            if file:
                _store(path, file, rng)
        begins.append(len(found))
        found += path
        progress((number + 1) / options.paths)
        more = number + 1 - least
        if enough is not None and more >= 0 and more % new == 0 and number + 1 > new:
            last = begins[-new]
            if enough(found[:last], found[last:]):
                progress(1.0)
                break
    return found


def _store(path: list[Sample], file: Path, rng: np.random.Generator) -> None:
    """Write a path, and the state of the random numbers after it; a reader never sees half of it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, Any] = {name: np.array([getattr(sample, name) for sample in path]) for name in _ARRAYS}
    part = file.with_suffix(".part.npz")
    np.savez(part, state=np.array(json.dumps(rng.bit_generator.state)), **arrays)
    part.replace(file)


def _stored(file: Path, rng: np.random.Generator) -> list[Sample] | None:
    """Return a stored path and set the random numbers to the state after it; None when there is none."""
    try:
        with np.load(file) as stored:
            arrays = [stored[name] for name in _ARRAYS]
            rng.bit_generator.state = json.loads(str(stored["state"]))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    return [Sample(*values) for values in zip(*arrays)]


def _path(model: RobotModel, options: TrainingOptions, rng: np.random.Generator) -> Iterator[Sample]:
    """Yield the equilibria along one random path."""
    low, high = options.modulus_range
    size = GRAVITY / np.exp(rng.uniform(np.log(low), np.log(high)))
    kind = rng.random()
    target = None
    if kind >= _RELEASED and model.robot.cables:
        bend = 0.0 if kind < _RELEASED + _STRAIGHT else rng.uniform(0.0, options.bend)
        weight = rng.choice([0.0, direction_weight(model.length)])
        target = rest_target(model.robot, bend, rng.uniform(0.0, 2.0 * np.pi), tip_direction_weight=weight)
    simulator, controller = Simulator(model, reduced=False, searches=False), InverseController(model.robot)
    simulator.solver.tolerance = _TOLERANCE * model.length
    wanted, displacement, lost = size * _direction(rng), None, 0
    largest = _largest_load(model, rng)
    gravity = _start(simulator.solver, wanted)
    if gravity is None:
        return
    reached, part, turned, waited = gravity, 1.0, 0.0, 0
    axis, left, turn = *_way(gravity, wanted), _TURN_AT_START
    steps = options.steps + int(np.ceil(left / turn))
    simulator.solver.extrapolates = True  # gravity turns evenly
    before = model.free(simulator.solver.state.u).copy()
    for step in range(steps):
        load = largest * np.append(np.full(6, np.sin(np.pi * (step + 1) / steps)), 1.0)
        shape = simulator.step(gravity, displacement, wrench=wrench_of(load))
        found = shape.is_equilibrium
        if found:
            unknowns = model.free(simulator.displacements).copy()
            if step:
                moved = float(np.abs(unknowns - before).max()) / model.length
                part = min(1.0, _GROWING * part, part * _FARTHEST / max(moved, 1e-3 * _FARTHEST))
            before = unknowns
            lost, reached = 0, gravity
            left -= turned
            yield Sample(unknowns, gravity, shape.cable_tension.copy(), simulator.solver.sliding.direction, load)
        else:
            lost, part = lost + 1, 0.5 * part
            if lost == _LOST_STEPS:
                return
        if left <= 0.0:
            axis, left, turn = _direction(rng), _STRAIGHT_ON, _TURN
        far = False
        if found and target is not None:
            command = controller.step(
                shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension, interval=_INTERVAL
            )
            displacement, far = command.displacement, command.lateral > _FARTHEST * model.length
        waited = waited + 1 if far and waited < _MOST_WAITS else 0
        turned = 0.0 if waited else min(part * turn, left)
        gravity = _rotated(reached, axis, turned)
        if not found and displacement is not None:
            # Half as far for the cables, too. The controller would take its command back and then go on in small steps, as in
            # the loop, which has hundreds of them; a path has fifteen.
            displacement = shape.cable_displacement + 0.5 * (displacement - shape.cable_displacement)
            controller.reset(displacement)


def _start(solver: StaticSolver, gravity: np.ndarray) -> np.ndarray | None:
    """Bring the straight robot, its cables released, to an equilibrium; return the gravity (3,) that acts there, None for none.

    It is `gravity` (3,) where one search from the straight robot finds its equilibrium, else that in which the robot hangs and
    stays nearly straight.
    """
    released = CableInput()
    if solver.track(gravity, released).converged:
        return gravity
    solver.reset()
    hanging = np.array([0.0, 0.0, np.linalg.norm(gravity)])
    return hanging if solver.track(hanging, released, iterations=15).converged else None


def _way(begin: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the axis (3,) and the angle in rad by which gravity turns from one direction to another."""
    across = np.cross(begin, end)
    angle = float(np.arctan2(np.linalg.norm(across), begin @ end))
    if not across.any():
        across = np.array([1.0, 0.0, 0.0])
    return across / np.linalg.norm(across), angle


def wrench_of(load: np.ndarray) -> Wrench | None:
    """Return a sample's external load (7,); None for none."""
    return Wrench(load[:3], load[3:6], float(load[6])) if load[:6].any() else None


def _largest_load(model: RobotModel, rng: np.random.Generator) -> np.ndarray:
    """Return the largest external load (7,) of a path. A robot without external loads needs no random numbers for it."""
    largest = model.robot.max_wrench
    if largest is None or rng.random() >= _LOADED:
        return np.append(np.zeros(6), 1.0)
    force, moment = rng.uniform(0.0, largest.force) * _direction(rng), rng.uniform(0.0, largest.moment) * _direction(rng)
    return np.concatenate([force, moment, [1.0 if rng.random() < _AT_TIP else rng.uniform(0.3, 1.0)]])


def _direction(rng: np.random.Generator) -> np.ndarray:
    """Return a random unit vector (3,)."""
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def _rotated(vector: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the vector (3,) rotated about the unit axis (3,), by Rodrigues' formula."""
    along = axis * (axis @ vector)
    return along + np.cos(angle) * (vector - along) + np.sin(angle) * np.cross(axis, vector)
