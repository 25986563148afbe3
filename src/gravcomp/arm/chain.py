"""Forward kinematics of a URDF from its root to the robot's base.

The pose of a link is the product of the joint transforms between root and link, each  T = T_origin T_axis(q)
(http://wiki.ros.org/urdf/XML/joint). Gravity in the link is  g = R^T (0, 0, -9.81),  where R is the rotation of the link in the
root, whose z axis points up.
"""

import math
import xml.etree.ElementTree as xml
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.standard_gravity import STANDARD_GRAVITY

_MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Joint:
    """A joint of the chain: origin (4, 4) in its parent link, axis (3,) of unit length."""

    name: str
    kind: str
    origin: np.ndarray
    axis: np.ndarray

    def transform(self, position: float) -> np.ndarray:
        """Return the transform (4, 4) at a position (rad or m)."""
        result = self.origin.copy()
        if self.kind == "prismatic":
            result[:3, 3] += self.origin[:3, :3] @ (self.axis * position)
        elif self.kind != "fixed":
            result[:3, :3] = self.origin[:3, :3] @ turn(self.axis, position)
        return result


class Chain:
    """The joints from `root` to `tip`, in this order."""

    def __init__(self, urdf: str, tip: str, root: str | None = None, source: str = "robot_description"):
        """Read the URDF; without `root`, its root link is used. Raises ConfigError when the URDF or a link is wrong."""
        try:
            document = xml.fromstring(urdf)
        except xml.ParseError as error:
            raise ConfigError(f"{source}: is not a URDF: {error}") from error
        links = [link.get("name", "") for link in document.iter("link")]
        joint_above = _tree(document, links, source)
        for name in (tip, root):
            if name is not None and name not in links:
                raise ConfigError(f"{source}: has no link '{name}'; it has: {', '.join(links) or 'none'}")
        self.joints: list[Joint] = []
        link = tip
        while link != root and link in joint_above:
            self.joints.insert(0, _joint(joint_above[link], source))
            link = _link(joint_above[link], "parent", source)
        if root is not None and link != root:
            raise ConfigError(f"{source}: link '{tip}' is not below '{root}' in the tree; its root is '{link}'")
        self.root, self.tip = link, tip

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the moving joints, whose positions are needed."""
        return tuple(joint.name for joint in self.joints if joint.kind in _MOVING)

    def pose(self, positions: Mapping[str, float]) -> np.ndarray:
        """Return the pose (4, 4) of the tip in the root. Raises KeyError for a moving joint without a position."""
        result = np.eye(4)
        for joint in self.joints:
            result = result @ joint.transform(positions[joint.name] if joint.kind in _MOVING else 0.0)
        return result

    def gravity(self, positions: Mapping[str, float]) -> np.ndarray:
        """Return gravity (3,) in the tip (m/s^2). Raises KeyError for a moving joint without a position."""
        return gravity_in(self.pose(positions)[:3, :3])


def gravity_in(rotation: np.ndarray) -> np.ndarray:
    """Return gravity (3,) in a frame (m/s^2), from its rotation (3, 3) in a frame whose z axis points up."""
    return -STANDARD_GRAVITY * rotation[2]


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle (rad) between two vectors (3,)."""
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def _joint(element: xml.Element, source: str) -> Joint:
    name, kind = element.get("name", ""), element.get("type", "")
    if kind not in (*_MOVING, "fixed"):
        allowed = ", ".join((*_MOVING, "fixed"))
        raise ConfigError(f"{source}: joint '{name}' is of type '{kind}'; allowed between the root and the robot: {allowed}")

    def numbers(element: xml.Element | None, key: str, default: str) -> list[float]:
        text = default if element is None else element.get(key, default)
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != 3 or not all(map(math.isfinite, values)):
            raise ConfigError(f"{source}: joint '{name}' has {key} '{text}'; three numbers are needed")
        return values

    origin = np.eye(4)
    given = element.find("origin")
    if given is not None:
        origin[:3, 3] = numbers(given, "xyz", "0 0 0")
        roll, pitch, yaw = numbers(given, "rpy", "0 0 0")
        x, y, z = np.eye(3)
        origin[:3, :3] = turn(z, yaw) @ turn(y, pitch) @ turn(x, roll)
    axis = element.find("axis")
    direction = np.array(numbers(axis, "xyz", "1 0 0"))
    length = float(np.linalg.norm(direction))
    if kind in _MOVING and length == 0.0:
        raise ConfigError(f"{source}: joint '{name}' has an axis of length 0")
    return Joint(name, kind, origin, direction / (length or 1.0))


def _tree(document: xml.Element, links: list[str], source: str) -> dict[str, xml.Element]:
    """Return the joint above each link. Raises ConfigError for links that are not one tree.

    That is: names that stand twice, two parents, a loop, two roots.
    """
    above: dict[str, xml.Element] = {}
    joints = [joint for joint in document.iter("joint") if joint.find("child") is not None]
    for what, names in (("links", links), ("joints", [joint.get("name", "") for joint in joints])):
        twice = sorted({name for name in names if name and names.count(name) > 1})
        if twice:
            raise ConfigError(f"{source}: has two {what} of the name '{twice[0]}'; a name stands for one")
    for joint in joints:
        child, name = _link(joint, "child", source), joint.get("name")
        if child in above:
            raise ConfigError(f"{source}: link '{child}' is below two joints, '{above[child].get('name')}' and '{name}'")
        if child not in links:
            raise ConfigError(f"{source}: joint '{name}' has the child link '{child}', which is not in it")
        above[child] = joint
    for link in links:
        way = [link]
        while way[-1] in above:
            way.append(_link(above[way[-1]], "parent", source))
            if way[-1] == link:
                raise ConfigError(f"{source}: the links {', '.join(way[:-1])} are a loop; a URDF is a tree")
            if len(way) > len(links):
                break  # below a loop, which the loop's own links report
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        raise ConfigError(f"{source}: has several roots, the links {', '.join(roots)}; a URDF has one: is a joint missing?")
    return above


def _link(joint: xml.Element, end: str, source: str) -> str:
    """Return the link at one end, `parent` or `child`, of a joint."""
    element = joint.find(end)
    name = None if element is None else element.get("link")
    if name is None:
        raise ConfigError(f"{source}: joint '{joint.get('name')}' has no {end} link")
    return name


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation (3, 3) about a unit axis by an angle (rad), by Rodrigues' formula."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * k @ k
