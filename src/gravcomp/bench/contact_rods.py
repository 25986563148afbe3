"""The finite-element model against the rod of the virtual robot in the same scenes: two codes, each with its own contact."""

import dataclasses
from collections.abc import Callable

import numpy as np

from gravcomp.bench.contact_scenes import moved_robot, random_scene, seeded_gravity
from gravcomp.description import Robot, load_robot_file
from gravcomp.description.hardware import Hardware
from gravcomp.scene.scene import Scene
from gravcomp.simulation import RobotModel, Simulator
from gravcomp.virtual.body import build_friction, build_material, build_rod
from gravcomp.virtual.draw import draw
from gravcomp.virtual.dynamics import MovingRod
from gravcomp.virtual.equilibrium import equilibrium
from gravcomp.virtual.parameters import Body, VirtualRobotParameters
from gravcomp.virtual.surroundings import RodSurroundings
from gravcomp.virtual.true_robot import TrueRobot

_SCENES = 30
_RISE, _REST, _STEP = 1.0, 0.5, 2e-3  # s in which the weight comes, and until the rod rests; s of a step
_DAMPING = 0.03  # s, changes no equilibrium


def rods(progress: Callable[[str], None], every: int = 1) -> dict:
    """Return figures of seeded scenes without friction, cables released, with every `every`-th of them.

    `rod_tip_pct`: distance of the two tips, of the length, median and worst; `rod_force_pct`: difference of the forces of the
    walls, of the larger one, where it is at least a hundredth of the weight; `rod_by_scene`: both for each scene in which both
    touch. Left out are scenes that cut the straight robot, from which the rod does not start, and those without an equilibrium.
    """
    file, robot = load_robot_file("article"), moved_robot()
    model, true = RobotModel(robot), described_rod(robot, file.hardware)
    found: dict[str, dict[str, float]] = {}
    for seed in range(0, _SCENES, every):
        progress(f"rod and model, scene {seed + 1} of {_SCENES}")
        scene, gravity = random_scene(seed, robot, rough=False), seeded_gravity(seed)
        simulator = Simulator(model, reduced=False, scene=scene)
        contact = simulator.solver.contact
        assert contact is not None
        if contact.depth(np.zeros_like(model.mesh.nodes)) > 0.0:
            continue
        shape = simulator.solve(gravity)
        tip, force = resting_rod(true, scene, gravity)
        if not shape.is_equilibrium or not (len(shape.contacts) and force.any()):
            continue
        of_model, of_rod = (float(np.linalg.norm(f)) for f in (shape.contacts.force.sum(axis=0), force))
        row = found[str(seed)] = {"tip": 100.0 * float(np.linalg.norm(tip - shape.tip_position)) / model.length}
        if max(of_model, of_rod) > 1e-2 * model.mass * float(np.linalg.norm(gravity)):
            difference = force - shape.contacts.force.sum(axis=0)
            row["force"] = 100.0 * float(np.linalg.norm(difference)) / max(of_model, of_rod)
    return {
        "rod_tip_pct": _spread([row["tip"] for row in found.values()]),
        "rod_force_pct": _spread([row["force"] for row in found.values() if "force" in row]),
        "rod_by_scene": found,
    }


def described_rod(robot: Robot, hardware: Hardware) -> TrueRobot:
    """Return the virtual robot as it is described: elastic, and nothing is drawn that an equilibrium depends on."""
    material = robot.segments[0].material
    body = Body(
        youngs_modulus=material.youngs_modulus, poissons_ratio=material.poissons_ratio, density=material.density,
        creep_ratio=(), creep_time=(), damping_time=_DAMPING, slip_ratio=0.0,
    )  # fmt: skip
    return draw(dataclasses.replace(VirtualRobotParameters(), body=body), robot, hardware)


def resting_rod(true: TrueRobot, scene: Scene, gravity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Let gravity (3,) rise on the unloaded rod in a scene. Returns tip (3,) in m and force (3,) of the walls in N at rest."""
    model = build_rod(true)
    rod = MovingRod(model, build_material(model, true), build_friction(true), RodSurroundings.of(model, true, scene))
    rod.rest(equilibrium(model, np.zeros(3)), np.eye(3), np.zeros(3))
    released = np.full(model.tendons, -0.1 * true.robot.length)
    for step in range(round((_RISE + _REST) / _STEP)):
        rod.step(_STEP, np.eye(3), np.zeros(3), min(1.0, (step + 1) * _STEP / _RISE) * gravity, released)
    return rod.position[-1].copy(), rod.touches.force.sum(axis=0)


def _spread(values: list[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "worst": max(values)} if values else {}
