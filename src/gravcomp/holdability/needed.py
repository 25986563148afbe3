"""What would hold a robot in its worst direction: the least tension, and the pitch radius of the cables that fits the limits."""

import dataclasses

import numpy as np

from gravcomp.description import Cable, Robot
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.holdability.answer import Binding, DirectionAnswer, Needed
from gravcomp.holdability.search import HoldSearch
from gravcomp.mesh import MeshError
from gravcomp.standard_gravity import STANDARD_GRAVITY

# Halvings of the range of the least tension, and of that of the largest radius in the body.
_TENSION_HALVINGS, _RADIUS_HALVINGS = 4, 12
# Attempts at a radius, each from the tension that the last one needs; and how much above the estimate the first one is.
_ATTEMPTS, _ABOVE = 3, 1.02
_WIDEST = 20.0


def needed(search: HoldSearch, answer: DirectionAnswer) -> Needed | None:
    """Return what would hold the robot in the direction of `answer`; None where no tension does."""
    if answer.tension is None or answer.binding not in (Binding.TENSION, Binding.DISPLACEMENT):
        return None
    tension = _least_tension(search, answer)
    if answer.binding == Binding.DISPLACEMENT:
        return Needed(tension, answer.displacement)
    factor = _radius(search, answer, tension)
    widest = _widest(search.robot)
    fits = factor is not None and factor <= widest
    at_widest = None if fits or widest <= 1.0 else _at_radius(search, answer, widest)
    return Needed(tension, answer.displacement, factor, fits, widest, None if at_widest is None else at_widest.tension)


def _least_tension(search: HoldSearch, answer: DirectionAnswer) -> float:
    """Return the least tension limit in N that holds the tip, within a sixteenth of the range above the present limit."""
    assert answer.tension is not None
    low, high = search.limits.tension_max, max(answer.tension, search.limits.tension_max)
    if len(search.robot.cables) <= 4:  # no other cables take over
        return high
    gravity = STANDARD_GRAVITY * answer.direction
    first, _ = search.linear.tension(gravity)
    for _ in range(_TENSION_HALVINGS):
        middle = 0.5 * (low + high)
        points = search.path.follow(gravity, dataclasses.replace(search.wide, tension_max=middle), np.minimum(first, middle))
        if points and points[-1].share >= 1.0 and points[-1].lateral <= search.tolerance:
            high = middle
        else:
            low = middle
    return high


def _radius(search: HoldSearch, answer: DirectionAnswer, tension: float) -> float | None:
    """Return the factor of the pitch radii with which the limits hold the tip; computed where it fits the body, else estimated.

    The moment of a cable is its tension times its radius.
    """
    factor = _ABOVE * tension / search.limits.tension_max
    for _ in range(_ATTEMPTS):
        found = _at_radius(search, answer, factor)
        if found is None:  # outside the body: the estimate remains
            return factor
        if found.held:
            return factor
        if found.demand is None:
            return None
        factor *= _ABOVE * max(found.demand, 1.0)
    return None


def _at_radius(search: HoldSearch, answer: DirectionAnswer, factor: float) -> DirectionAnswer | None:
    """Return the answer with the pitch radii times `factor`; None where these cables do not fit the body."""
    try:
        model = RobotModel(_scaled(search.robot, factor))
    except (ValueError, MeshError):
        return None
    return HoldSearch(model, search.target, search.options).answer(answer.direction)


def _widest(robot: Robot) -> float:
    """Return the largest factor of the pitch radii with which the cables stay in the body described."""
    low, high = 1.0, _WIDEST
    for _ in range(_RADIUS_HALVINGS):
        middle = 0.5 * (low + high)
        try:
            _scaled(robot, middle)
            low = middle
        except ValueError:
            high = middle
    return low


def _scaled(robot: Robot, factor: float) -> Robot:
    """Return the robot with its cables `factor` times as far from the axis. Raises ValueError where they leave the body."""

    def moved(cable: Cable) -> Cable:
        if cable.via_points is not None:
            return dataclasses.replace(cable, via_points=tuple((factor * x, factor * y, z) for x, y, z in cable.via_points))
        assert cable.radius is not None  # Cable.__post_init__
        tip = None if cable.tip_radius is None else factor * cable.tip_radius
        return dataclasses.replace(cable, radius=factor * cable.radius, tip_radius=tip)

    return dataclasses.replace(robot, cables=tuple(moved(cable) for cable in robot.cables))
