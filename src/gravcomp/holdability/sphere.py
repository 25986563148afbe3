"""Answers for directions of gravity all over the sphere, the worst of them, and what would be needed there."""

from collections.abc import Callable

import numpy as np

from gravcomp.description import Robot
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.statics import StaticSolver
from gravcomp.holdability.answer import Binding, DirectionAnswer, Holdability
from gravcomp.holdability.directions import angles, sphere
from gravcomp.holdability.needed import needed
from gravcomp.holdability.options import HoldOptions
from gravcomp.holdability.search import HoldSearch
from gravcomp.holdability.symmetry import known_answer, turns
from gravcomp.inverse.target import Target
from gravcomp.standard_gravity import STANDARD_GRAVITY

Progress = Callable[[int, int, DirectionAnswer], None]
"""Called with the number of answers so far, their number at the end, and the latest one."""

# The linear estimate looks for the worst direction on a sphere so much finer.
_FINER = 3
_PARTS = 16  # of the search for the released shape


def holdability(
    robot: Robot | RobotModel,
    target: Target | None = None,
    options: HoldOptions | None = None,
    *,
    directions: np.ndarray | None = None,
    progress: Progress | None = None,
    first: Callable[[str], None] | None = None,
    with_needed: bool = True,
) -> Holdability:
    """Return whether the robot's cables keep its tip laterally on the target.

    target: default the tip at rest; directions (k, 3) of gravity: default all over the sphere, and the worst of the linear
    estimate first; progress: see `Progress`; first: called with the linear estimate, as a sentence, before the paths are
    followed; with_needed: find also what would be needed, where it buckles, and the released shape. Raises MeshError for a
    body that cannot be meshed, ValueError for a robot without cables.
    """
    model = robot if isinstance(robot, RobotModel) else RobotModel(robot)
    search = HoldSearch(model, target, options)
    asked = _directions(search) if directions is None else np.asarray(directions, float)
    asked = asked / np.linalg.norm(asked, axis=1, keepdims=True)
    answers: list[DirectionAnswer | None] = [None] * len(asked)
    computed: list[DirectionAnswer] = []
    # The worst first: it is the answer that the user waits for.
    demands = np.array([search.linear_demand(direction) for direction in asked])
    order = np.argsort(-demands, kind="stable")
    if first and target is None:
        first(_estimate(search, asked[order[0]]))
    for count, index in enumerate(order):
        answer = known_answer(search.symmetries, computed, asked[index])
        if answer is None:
            answer = search.answer(asked[index])
            computed.append(answer)
        answers[index] = answer
        if progress:
            progress(count + 1, len(asked), answer)
    return _summary(search, tuple(answer for answer in answers if answer), with_needed)


def _directions(search: HoldSearch) -> np.ndarray:
    """Return the sphere's directions (k, 3), the first of them the worst of the linear estimate on a finer sphere."""
    equator, number = search.options.equator, turns(search.symmetries)
    fine = sphere(_FINER * equator, number)
    worst = fine[int(np.argmax([search.linear_demand(direction) for direction in fine]))]
    return np.vstack([worst, sphere(equator, number)])


def _estimate(search: HoldSearch, direction: np.ndarray) -> str:
    """Return the linear estimate of the robot at rest for a direction (3,), as a sentence."""
    tension, lateral = search.linear.tension(STANDARD_GRAVITY * direction)
    inclination, azimuth = np.degrees(angles(direction))
    where = f"gravity {inclination:.0f} deg from the axis toward {azimuth:.0f} deg"
    if lateral > search.tolerance:
        return f"First answer, from the linear response at rest: the cables do not hold the tip with {where}"
    return (
        f"First answer, from the linear response at rest: worst with {where}, where the cables need"
        f" {tension.max():.3g} N of {search.limits.tension_max:g} N"
    )


def _summary(search: HoldSearch, answers: tuple[DirectionAnswer, ...], with_needed: bool) -> Holdability:
    """Return the whole answer; with_needed: as in `holdability`."""
    worst = int(np.argmax([answer.severity for answer in answers]))
    answer, limits = answers[worst], search.limits
    overload, buckling, where = _buckling(search, answers) if with_needed else (search.options.overload, None, None)
    return Holdability(
        model=f"full model, {search.model.pattern.n} unknowns",
        tolerance=search.tolerance,
        directions=answers,
        worst=worst,
        released=_released(search, answer.direction) if with_needed else None,
        buckling=buckling,
        buckling_direction=where,
        overload=overload,
        needed=None if answer.held or not with_needed else needed(search, answer),
        tension_max=limits.tension_max,
        displacement_min=limits.displacement_min,
        displacement_max=limits.displacement_max,
    )


def _buckling(search: HoldSearch, answers: tuple[DirectionAnswer, ...]) -> tuple[float, float | None, np.ndarray | None]:
    """Return the factor of gravity up to which was looked, the least at which a held robot buckles, and the direction (3,)."""
    followed = [answer for answer in answers if answer.binding != Binding.TARGET]
    ended = [answer for answer in followed if answer.end is not None and answer.known]
    if ended:
        first = min(ended, key=lambda answer: answer.end or 0.0)
        return search.options.overload, first.end, first.direction
    # Where a search has ended, or a path was left, a larger load has not been looked at.
    if not followed or search.path.leaves or not all(answer.known for answer in followed):
        return 1.0, None, None
    weakest = min(followed, key=lambda answer: answer.eigenvalue)
    gravity, most = STANDARD_GRAVITY * weakest.direction, search.options.overload
    first_tension, _ = search.linear.tension(gravity)
    last = search.path.follow(gravity, search.wide, first_tension, most=most)[-1].share
    return most, *((last, weakest.direction) if last < most else (None, None))


def _released(search: HoldSearch, direction: np.ndarray) -> float | None:
    """Return the lateral error in m of the released robot under gravity in a direction (3,)."""
    state = StaticSolver(search.model).solve(STANDARD_GRAVITY * direction, CableInput(), parts=_PARTS)
    return search.path.lateral(state) if state.converged else None
