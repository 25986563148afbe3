"""A robot that coils back to itself: how deep it is in itself, energy over a closed path, and the virtual robot's rod."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.bench.sampled_depth import sampled_own_depth
from gravcomp.description import Elements, RobotFile, load_robot_file
from gravcomp.full_model.shape import Shape
from gravcomp.simulation import Simulator
from gravcomp.virtual.body import build_friction, build_material, build_rod
from gravcomp.virtual.draw import draw
from gravcomp.virtual.dynamics import MovingRod
from gravcomp.virtual.equilibrium import equilibrium
from gravcomp.virtual.parameters import Body, Tendons, VirtualRobotParameters
from gravcomp.virtual.surroundings import RodSurroundings

COILED = Path(__file__).resolve().parents[2] / "examples" / "coiled_robot.yaml"
COILED_FROM = 12e-3  # m of cable c1, at which the rod begins
GRAVITY = np.array([0.3, 0.2, -9.8])  # a little from the axis: it tells the tip to which side of the stem to go
_UP = (*range(1, 14), 13.5)  # mm of cable c1, until it touches itself
_STEP, _HIGHEST, _BRIEF = 0.5, 20.0, 14.0  # mm, from there on
_DAMPING, _RATE, _DT, _REST = 0.03, 4e-3, 2e-3, 0.4  # s, changes no equilibrium; m/s of winding; s of a step, and until it rests


def coiled(progress: Callable[[str], None], brief: bool = False) -> dict:
    """Return figures of the example's robot, wound up beyond a full turn and back.

    `self_contact_depth_mm`: deepest place of its surface in itself; `self_contact_energy`: work of the cable over the closed
    path, as a share of that without sign; `self_contact_force_pct` and `self_contact_tip_pct`: the rod's sum of forces and tip
    against the model's, of the force and the length, worst; `free_tip_pct`: of the tips just before the robot touches itself.
    """
    file = coarse(coiled_file()) if brief else coiled_file()
    simulator = Simulator(file.robot, reduced=False, scene=file.scene)
    contact = simulator.solver.contact
    assert contact is not None and contact.own is not None
    highest = _BRIEF if brief else _HIGHEST
    further = list(np.arange(_UP[-1] + _STEP, highest + 0.5 * _STEP, _STEP))
    shapes: dict[float, Shape] = {}
    deepest, pull, wound = -np.inf, [], []
    for goal in (*_UP, *further, *further[-2::-1], _UP[-1]):
        progress(f"a robot that touches itself, {goal:g} mm of cable")
        shape = shapes[goal] = simulator.step(GRAVITY, np.array([1e-3 * goal, np.nan, np.nan]))
        if goal >= _UP[-1]:
            deepest = max(deepest, sampled_own_depth(simulator.model, simulator.solver.state.u, contact.own.surface))
            pull.append(float(shape.cable_tension[0]))
            wound.append(1e-3 * goal)
    work = 0.5 * (np.array(pull[1:]) + np.array(pull[:-1])) * np.diff(wound)
    figures = {
        "self_contact_depth_mm": 1e3 * deepest,
        "self_contact_energy": abs(float(work.sum())) / float(np.abs(work).sum()),
    }
    if brief:
        return figures
    rod, force, tip, before = coiled_rod(file), [], {}, COILED_FROM
    for goal in (_UP[-2], *further[1::4]):
        progress(f"the rod that touches itself, {goal:g} mm of cable")
        wind(rod, before, 1e-3 * goal)
        before = 1e-3 * goal
        shape = shapes[goal]
        tip[goal] = 100.0 * float(np.linalg.norm(rod.position[-1] - shape.tip_position)) / file.robot.length
        pushed, of_model = np.linalg.norm(rod.touches.force.sum(axis=0)), np.linalg.norm(shape.contacts.force.sum(axis=0))
        if of_model > 0.0:
            force.append(100.0 * abs(float(pushed / of_model) - 1.0))
    return figures | {
        "self_contact_force_pct": max(force), "self_contact_tip_pct": max(tip.values()), "free_tip_pct": tip[_UP[-2]],
    }  # fmt: skip


def coiled_file() -> RobotFile:
    """Return the robot file of the example."""
    return load_robot_file(str(COILED))


def coarse(file: RobotFile) -> RobotFile:
    """Return a robot file with few elements: fewer than such a coil needs to be exact."""
    return dataclasses.replace(file, robot=dataclasses.replace(file.robot, elements=Elements(around=4, along=16)))


def coiled_rod(file: RobotFile) -> MovingRod:
    """Return the rod of the example's robot as it is described, elastic and without friction, wound up by COILED_FROM."""
    robot = file.robot
    material, line = robot.segments[0].material, robot.cables[0]
    body = Body(
        modulus_ratio=(1.0,), poissons_ratio=material.poissons_ratio, density=material.density, creep_ratio=(), creep_time=(),
        damping_time=_DAMPING, slip_ratio=0.0,
    )  # fmt: skip
    lines = Tendons(
        friction=0.0, radius_offset=0.0, angle_offset=0.0, guide_angle=0.0, free_length=line.free_length,
        axial_stiffness=line.axial_stiffness,
    )  # fmt: skip
    true = draw(dataclasses.replace(VirtualRobotParameters(), body=body, tendons=lines), robot, file.hardware)
    model = build_rod(true)
    around = RodSurroundings.of(model, true, file.scene)
    rod = MovingRod(model, build_material(model, true), build_friction(true), around)
    start = None
    for wound in np.linspace(0.1, 1.0, 12) * COILED_FROM:
        start = equilibrium(model, GRAVITY, displacement=_cables(rod, wound), start=start)
    assert start is not None
    rod.rest(start, np.eye(3), np.zeros(3))
    return rod


def wind(rod: MovingRod, before: float, goal: float) -> bool:
    """Wind cable c1 from `before` to `goal` m, and let the rod rest; return whether every step converged."""
    count, converged = max(1, round(abs(goal - before) / _RATE / _DT)), True
    for step in range(count + round(_REST / _DT)):
        wound = before + (goal - before) * min(1.0, (step + 1) / count)
        converged &= rod.step(_DT, np.eye(3), np.zeros(3), GRAVITY, _cables(rod, wound))
    return converged


def _cables(rod: MovingRod, wound: float) -> np.ndarray:
    """Return the displacements (m,) of all cables: the first is wound in, the others are slack."""
    slack = np.full(rod.model.tendons, -0.1 * float(rod.model.length.sum()))
    slack[0] = wound
    return slack
