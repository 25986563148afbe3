"""Scenes of the benchmarks of contact: from the keys of a robot file, or drawn by a seed, with the robot and gravity in them."""

import dataclasses
from typing import Any

import numpy as np

from gravcomp.config import from_mapping
from gravcomp.description import Elements, Robot, load_robot_file
from gravcomp.scene import SceneSection
from gravcomp.scene.scene import Scene

GRAVITY = 9.81  # m/s^2


def scene_of(**kinds: Any) -> Scene:
    """Return a scene of the obstacles that a section `scene` would have."""
    return Scene(from_mapping(SceneSection, kinds, source="scene", key="scene"))


def moved_robot() -> Robot:
    """Return the robot of the seeded scenes: the article's, with fewer elements."""
    return dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=6, along=10))


def random_scene(seed: int, robot: Robot, rough: bool = True) -> Scene:
    """Return an obstacle in the way of a sagging robot: a plane, a ball, a peg, a cuboid or a tube, some of them `rough`."""
    rng = np.random.default_rng(seed)
    length, radius = 1e3 * robot.length, 0.5e3 * robot.segments[0].outer_diameter
    place, deep = rng.uniform(0.5, 1.0) * length, rng.uniform(0.03, 0.15) * length
    friction = float(rng.choice([0.0, 0.3])) * rough
    angle = rng.uniform(-0.3, 0.3)
    down = np.array([-np.cos(angle), np.sin(angle), 0.0])
    common = {"friction": friction}
    size = rng.uniform(0.5, 2.0) * radius
    middle = (down * (radius + deep + size) + [0.0, 0.0, place]).tolist()
    kind = seed % 5
    if kind == 0:
        return scene_of(planes=[common | {"normal": (-down).tolist(), "point_mm": (down * (radius + deep)).tolist()}])
    if kind == 1:
        return scene_of(spheres=[common | {"centre_mm": middle, "radius_mm": size}])
    across = np.cross(down, [0.0, 0.0, 1.0]) * length
    if kind == 2:
        ends = [(np.array(middle) - across).tolist(), (np.array(middle) + across).tolist()]
        return scene_of(tubes=[common | {"points_mm": ends, "radius_mm": [size], "side": "outside"}])
    if kind == 3:
        box = {"centre_mm": middle, "size_mm": [2 * size] * 3, "rpy_deg": [0.0, 0.0, float(np.degrees(-angle))]}
        return scene_of(boxes=[common | box])
    bend = rng.uniform(-0.2, 0.2, 2) * length
    line = [[0, 0, -length / 5], [0, 0, length / 3], [bend[0] / 2, bend[1] / 2, length], [bend[0], bend[1], 1.5 * length]]
    return scene_of(tubes=[common | {"points_mm": line, "radius_mm": [radius + deep / 2]}])


def seeded_gravity(seed: int) -> np.ndarray:
    """Return gravity (3,) in m/s^2 for a robot that lies nearly horizontal."""
    tilt = np.random.default_rng(1000 + seed).uniform(-0.3, 0.3)
    return GRAVITY * np.array([-np.cos(tilt), 0.0, np.sin(tilt)])
