"""Turns and mirrors about the axis that map a robot onto itself: with them an answer holds for several directions of gravity.

A robot with round sections and three equal cables at equal angles has six of them: a sixth of the sphere tells the whole of it.
They follow from its description, whatever its mesh. Those of other bodies are those of their meshes: a flat or elliptic one with
four cables has four.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from gravcomp.description import Cable, Robot
from gravcomp.full_model import symmetry as of_model
from gravcomp.full_model.model import MeshedModel
from gravcomp.holdability.answer import DirectionAnswer
from gravcomp.inverse.target import Target

_SAME = 1e-6  # rad; and of unit vectors and of the robot's length
# Sections are compared at these parts of a segment's length: the sizes of a taper are linear between base and tip.
_PARTS = (0.0, 0.5, 1.0)


class Symmetry(NamedTuple):
    """matrix (3, 3), orthogonal; images: of every cable the name of the one onto which it is mapped."""

    matrix: np.ndarray
    images: dict[str, str]

    def of(self, answer: DirectionAnswer) -> DirectionAnswer:
        """Return the answer for the image of an answer's direction."""
        cable = None if answer.cable is None else self.images[answer.cable]
        return dataclasses.replace(answer, direction=self.matrix @ answer.direction, cable=cable)


def symmetries(robot: Robot, target: Target) -> list[Symmetry]:
    """Return the symmetries of a robot with this target for its tip; of one that is not round only the identity."""
    found = [Symmetry(np.eye(3), {cable.name: cable.name for cable in robot.cables})]
    if not _round(robot) or not _on_axis(robot, target):
        return found
    angles = [cable.angle for cable in robot.cables if cable.angle is not None]
    for mirrored in (False, True):
        sign = -1.0 if mirrored else 1.0
        seen: list[float] = [] if mirrored else [0.0]
        for angle in angles:
            turn = angle - sign * angles[0]
            images = _images(robot.cables, sign, turn)
            if images is None or any(_apart(turn, other) < _SAME for other in seen):
                continue
            seen.append(turn)
            c, s = np.cos(turn), np.sin(turn)
            found.append(Symmetry(np.array([[c, -sign * s, 0.0], [s, sign * c, 0.0], [0.0, 0.0, 1.0]]), images))
    return found


def symmetries_of(model: MeshedModel, target: Target) -> list[Symmetry]:
    """Return the symmetries of a robot with this target for its tip, of one that is not round those of its mesh."""
    robot = model.robot
    if _round(robot):
        return symmetries(robot, target)
    names = robot.cable_names
    found = [Symmetry(np.eye(3), {name: name for name in names})]
    for symmetry in of_model.symmetries(model):
        if _stays(robot, target, symmetry.matrix):
            images = {name: names[there] for name, there in zip(names, symmetry.cables)}
            found.append(Symmetry(symmetry.matrix, images))
    return found


def turns(found: list[Symmetry]) -> int:
    """Return the number of turns among the symmetries, 1 for the identity alone."""
    return sum(np.linalg.det(symmetry.matrix) > 0.0 for symmetry in found)


def known_answer(found: list[Symmetry], answers: list[DirectionAnswer], direction: np.ndarray) -> DirectionAnswer | None:
    """Return the answer for a direction (3,) that follows from the answers for others; None where none of them is its image."""
    for answer in answers:
        for symmetry in found:
            if np.abs(symmetry.matrix @ answer.direction - direction).max() < _SAME:
                return symmetry.of(answer)
    return None


def _round(robot: Robot) -> bool:
    """Whether the robot without its cables looks the same from every side."""
    if robot.body is not None or robot.loads or any(robot.payload.centre[:2]):
        return False
    outlines = [
        outline
        for segment in robot.segments
        for part in (*_PARTS, *(station.z / segment.length for station in segment.stations))
        for outline in (segment.outline(part), *segment.lumen_outlines(part))
    ]
    plain = all(segment.rest is None and segment.material.fibres is None for segment in robot.segments)
    return plain and all(outline.round for outline in outlines)


def _places(robot: Robot, target: Target) -> np.ndarray:
    """Return the target as points (k, 3), those of tip and backbone over the robot's length."""
    return np.vstack([target.tip_position / robot.length, target.direction_or_zeros, target.backbone_position / robot.length])


def _stays(robot: Robot, target: Target, matrix: np.ndarray) -> bool:
    """Whether a matrix (3, 3) maps the target onto itself."""
    places = _places(robot, target)
    return bool((np.abs(places @ matrix.T - places) < _SAME).all())


def _on_axis(robot: Robot, target: Target) -> bool:
    """Whether all of the target lies on the axis."""
    places = _places(robot, target)
    return bool((np.abs(places[:, :2]) < _SAME).all())


def _images(cables: tuple[Cable, ...], sign: float, turn: float) -> dict[str, str] | None:
    """Return the cables onto which those at `angle` are mapped at sign * angle + turn (rad); None where one has no image."""
    images = {}
    for cable in cables:
        if cable.angle is None:
            return None
        there = sign * cable.angle + turn
        alike = [other for other in cables if other.angle is not None and _apart(other.angle, there) < _SAME]
        image = next((other for other in alike if dataclasses.replace(other, name=cable.name, angle=cable.angle) == cable), None)
        if image is None:
            return None
        images[cable.name] = image.name
    return images


def _apart(one: float, other: float) -> float:
    """Return the angle between two directions at these angles, all in rad."""
    return float(abs(np.mod(one - other + np.pi, 2.0 * np.pi) - np.pi))
