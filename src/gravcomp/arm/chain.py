"""Forward kinematics of a URDF from its root to the robot's base.

The pose of a link is the product of the joints on the way to it, each  T = T_origin T_axis(q)  (http://wiki.ros.org/urdf/XML/joint), and
gravity in it is  g = R^T (0, 0, -9.81)  with R the rotation of the link in the root, whose z points up.
"""

import math
import xml.etree.ElementTree as xml
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gravcomp.config import ConfigError

STANDARD_GRAVITY = 9.80665  # m/s^2
_MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Joint:
    """A joint of the chain: origin (4, 4) in its parent, axis (3,) of unit length."""

    name: str
    kind: str
    origin: np.ndarray
    axis: np.ndarray

    def transform(self, position: float) -> np.ndarray:
        """(4, 4) at a position in rad or m."""
        result = self.origin.copy()
        if self.kind == "prismatic":
            result[:3, 3] += self.origin[:3, :3] @ (self.axis * position)
        elif self.kind != "fixed":
            result[:3, :3] = self.origin[:3, :3] @ _turn(self.axis, position)
        return result


class Chain:
    """The joints from `root` to `tip`, in this order."""

    def __init__(self, urdf: str, tip: str, root: str | None = None, source: str = "robot_description"):
        """`root`: the URDF's own when not given. Raises ConfigError naming what is missing."""
        try:
            document = xml.fromstring(urdf)
        except xml.ParseError as error:
            raise ConfigError(f"{source}: is not a URDF: {error}") from error
        above = {joint.find("child").get("link"): joint for joint in document.iter("joint") if joint.find("child") is not None}
        links = [link.get("name") for link in document.iter("link")]
        for name in (tip, root):
            if name is not None and name not in links:
                raise ConfigError(f"{source}: has no link '{name}'; it has: {', '.join(links) or 'none'}")
        self.joints: list[Joint] = []
        link = tip
        while link != root and link in above:
            self.joints.insert(0, _joint(above[link], source))
            link = above[link].find("parent").get("link")
        if root is not None and link != root:
            raise ConfigError(f"{source}: link '{tip}' does not hang on '{root}'; its root is '{link}'")
        self.root, self.tip = link, tip

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the joints whose positions are needed."""
        return tuple(joint.name for joint in self.joints if joint.kind in _MOVING)

    def pose(self, positions: Mapping[str, float]) -> np.ndarray:
        """The tip in the root, (4, 4). Raises KeyError for a joint without position."""
        result = np.eye(4)
        for joint in self.joints:
            result = result @ joint.transform(positions[joint.name] if joint.kind in _MOVING else 0.0)
        return result

    def gravity(self, positions: Mapping[str, float]) -> np.ndarray:
        """(3,) m/s^2 in the tip."""
        return gravity_in(self.pose(positions)[:3, :3])


def gravity_in(rotation: np.ndarray) -> np.ndarray:
    """(3,) m/s^2 in a frame whose rotation (3, 3) in a frame with z up is given."""
    return -STANDARD_GRAVITY * rotation[2]


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """rad between two vectors (3,)."""
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def _joint(element: xml.Element, source: str) -> Joint:
    name, kind = element.get("name"), element.get("type")
    if kind not in (*_MOVING, "fixed"):
        raise ConfigError(
            f"{source}: joint '{name}' is of type '{kind}'; allowed on the way to the robot: {', '.join((*_MOVING, 'fixed'))}"
        )
    origin = np.eye(4)
    given = element.find("origin")
    if given is not None:
        origin[:3, 3] = _numbers(given.get("xyz", "0 0 0"))
        roll, pitch, yaw = _numbers(given.get("rpy", "0 0 0"))
        x, y, z = np.eye(3)
        origin[:3, :3] = _turn(z, yaw) @ _turn(y, pitch) @ _turn(x, roll)
    axis = element.find("axis")
    direction = np.array(_numbers(axis.get("xyz", "1 0 0") if axis is not None else "1 0 0"))
    return Joint(name, kind, origin, direction / np.linalg.norm(direction))


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def _turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * k @ k
