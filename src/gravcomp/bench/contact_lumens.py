"""Lumens as closed triangle meshes, as a user brings them from images: smooth, and rough by noise on their corners."""

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.bench.contact_scenes import scene_of
from gravcomp.description import Robot
from gravcomp.scene.scene import Scene

if TYPE_CHECKING:
    import trimesh

_EVERY = 10  # scenes, of which the last one is a mesh
_AROUND = 24  # corners of a section; along the lumen they are a radius apart
_NOISE = (0.0, 0.02, 0.04)  # of the lumen's radius, in turns: standard deviation of each coordinate of a corner


def is_lumen(seed: int) -> bool:
    """Return whether the scene of a seed is a lumen from a mesh."""
    return seed % _EVERY == _EVERY - 1


def mesh_lumen(seed: int, robot: Robot) -> Scene:
    """Return a bent lumen from a mesh around a robot, some of them with friction."""
    rng = np.random.default_rng(seed)
    length, radius = 1e3 * robot.length, 0.5e3 * robot.segments[0].outer_diameter
    radius += 0.5 * rng.uniform(0.03, 0.15) * length
    friction, bend = float(rng.choice([0.0, 0.3])), rng.uniform(-0.2, 0.2, 2)
    along = np.linspace(-0.2, 1.5, max(3, round(1.7 * length / radius)))
    line = length * np.column_stack([*(side * np.maximum(along, 0.0) ** 2 for side in bend), along])
    noise = _NOISE[seed // _EVERY % len(_NOISE)] * radius
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "lumen.stl"
        tube_surface(line, radius, noise, seed).export(file)
        return scene_of(meshes=[{"file": str(file), "file_unit_mm": 1, "side": "inside", "friction": friction}])


def tube_surface(line: np.ndarray, radius: float, noise: float, seed: int, around: int = _AROUND) -> "trimesh.Trimesh":
    """Return a closed tube around a line (n, 3), which is not across z, with normal noise on all coordinates of its corners."""
    import trimesh

    ahead = np.gradient(line, axis=0)
    one = np.cross([0.0, 1.0, 0.0], ahead)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    two = np.cross(ahead / np.linalg.norm(ahead, axis=1, keepdims=True), one)
    angle = 2 * np.pi * np.arange(around) / around
    tube = line[:, None] + radius * (np.cos(angle)[:, None] * one[:, None] + np.sin(angle)[:, None] * two[:, None])
    tube = tube.reshape(-1, 3) + noise * np.random.default_rng(seed).standard_normal((len(line) * around, 3))
    here = np.arange(around)
    beyond = (here + 1) % around
    rows = around * np.arange(len(line) - 1)[:, None]
    count, last = len(tube), around * (len(line) - 1)
    faces = np.concatenate([
        np.stack([rows + here, rows + beyond, rows + here + around], axis=-1).reshape(-1, 3),
        np.stack([rows + beyond, rows + beyond + around, rows + here + around], axis=-1).reshape(-1, 3),
        np.stack([np.full(around, count), beyond, here], axis=-1),
        np.stack([np.full(around, count + 1), last + here, last + beyond], axis=-1),
    ])  # fmt: skip
    return trimesh.Trimesh(np.vstack([tube, line[[0, -1]]]), faces, process=False)
