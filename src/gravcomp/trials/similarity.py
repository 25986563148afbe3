"""Robots of another size that behave alike: what in model and loop suits a single size shows as a difference.

With lengths times k, moduli times k and the same density, a robot under its own weight bends alike. Then

    lengths k,  forces k^3,  moments k^4,  stresses k,  times sqrt(k),  velocities sqrt(k),  masses k^3,  accelerations 1

(E. Buckingham, Phys. Rev. 4, 1914). Robot, motors, virtual robot and controller are scaled by the units of their declared
parameters. The IMU is not: its errors in the direction of gravity are angles, and its samples come every 10 ms at any size.

The robot comes to the compared pose by a slow turn. How it starts does not scale, because a small robot has fewer samples in a
period: its first commands overshoot by another share of its length, and gears with backlash, whose capstans rub more than the
idle cables pull, keep for good what they were wound beyond.
"""

import dataclasses
from typing import Any, TypeVar

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.config.declaration import parameter_of
from gravcomp.description import Robot
from gravcomp.full_model.chosen_elements import with_chosen_elements
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.trials.holding import Case, target_of
from gravcomp.virtual.body import build_rod
from gravcomp.virtual.equilibrium import equilibrium
from gravcomp.virtual.motion import WaypointMotion, base_orientation

SCALES = (0.5, 2.0, 4.0)

_POWERS = {
    "m": 1.0, "Pa": 1.0, "N": 3.0, "kg": 3.0, "s": 0.5, "m/s": 0.5, "N/s": 2.5, "1/s": -0.5, "1/m": -1.0, "m^2": 2.0,
    "N m": 4.0, "N m/A": 4.0, "N m s": 4.5, "A s/m": -0.5, "A/m": -1.0, "kg m^2": 5.0, "rad/s": -0.5, "Hz": -0.5,
}  # fmt: skip
"""Powers of k by SI unit; all other units stay."""

_CREEP_RATIO, _CREEP_TIME = (0.04, 0.03, 0.03), (0.2, 2.0, 20.0)  # s at k = 1; drawn ones belong to the material, not to the size
# In first periods: held hanging, the turn until horizontal, held there, and at the end, which counts.
_HANGING, _TURN, _HELD, _COUNTED = 6.0, 10.0, 8.0, 2.0

_SHARES = ("moving", "lateral", "axial", "model")  # of the sag

Declared = TypeVar("Declared")


def scaled(value: Declared, k: float) -> Declared:
    """Return a declared data class with every number scaled by its unit; what is not declared stays."""
    changes = {}
    for field in dataclasses.fields(value):  # type: ignore[arg-type]
        inner, declared = getattr(value, field.name), parameter_of(field)
        if not field.init:
            continue
        power = 0.0 if declared is None else _POWERS.get(declared.unit, 0.0)
        changes[field.name] = _scaled(inner, k, k**power)
    return dataclasses.replace(value, **changes)  # type: ignore[type-var]


def _scaled(value: Any, k: float, factor: float) -> Any:
    if dataclasses.is_dataclass(value):
        return scaled(value, k)
    if isinstance(value, (tuple, list)):
        return type(value)(_scaled(one, k, factor) for one in value)
    return value * factor if isinstance(value, float) and factor != 1.0 else value


def scaled_setup(setup: Setup, k: float) -> Setup:
    """Return the setup of the robot k times as long."""
    board = setup.truth.board
    body = dataclasses.replace(setup.truth.body, creep_ratio=_CREEP_RATIO, creep_time=_CREEP_TIME)
    truth = dataclasses.replace(setup.truth, body=body)
    return dataclasses.replace(
        setup,
        robot=scaled(_by_stiffness(with_chosen_elements(setup.robot)), k),
        nominal=scaled(_by_stiffness(setup.nominal), k),
        truth=dataclasses.replace(scaled(truth, k), board=board),
        hardware=scaled(setup.hardware, k),
        nominal_hardware=None if setup.nominal_hardware is None else scaled(setup.nominal_hardware, k),
        controller=dataclasses.replace(setup.controller, inverse=scaled(setup.controller.inverse, k)),
    )


def _by_stiffness(robot: Robot) -> Robot:
    """Return the robot with lines of the stiffness that their material gives: E A grows by k^3, a thicker line by k^2."""
    cables = tuple(cable.with_stiffness(cable.stiffness) if cable.stretches else cable for cable in robot.cables)
    return dataclasses.replace(robot, cables=cables)


def held_figures(setup: Setup) -> dict[str, float]:
    """Return numbers without a unit of the robot that the loop holds straight while it turns from hanging to horizontal.

    sag: released and horizontal, from the shape at rest, over the length; moving: lateral error during the turn, its root mean
    square over the sag; lateral, axial: mean of the true tip at the end from the target, over the sag, against the sag and along
    the tip; model: as lateral, of the modelled tip; tension: the largest one over its limit; command: the largest one over the
    length.
    """
    pose, length, period = base_orientation(0.0), setup.robot.length, setup.first_period
    target = target_of(setup, Case(0.0))
    along = target.direction_or_zeros

    def lateral(tips: np.ndarray) -> np.ndarray:
        """Parts (t, 3) of the distances of tips (t, 3) from the target across its direction."""
        away = tips - target.tip_position
        return away - np.outer(away @ along, along)

    released = equilibrium(build_rod(setup.true_robot), pose.T @ [0.0, 0.0, -STANDARD_GRAVITY]).tip
    sagged = lateral(released[None])[0]
    sag = float(np.linalg.norm(sagged))
    upward = -sagged / sag
    quarter = 0.5 * np.pi
    stops = [(base_orientation(-quarter), _HANGING * period), (pose, _HELD * period)]
    motion = WaypointMotion(stops, quarter / (_TURN * period))
    loop = ClosedLoop(setup, motion)
    loop.hold(target)
    loop.run(motion.duration - loop.time)
    (_, begin), (end, _) = motion.rests
    turning, held = loop.trace.between(begin, end), loop.trace.between(loop.time - _COUNTED * period)
    return {
        "sag": sag / length,
        "moving": float(np.sqrt((lateral(turning.tip_position) ** 2).sum(axis=1).mean())) / sag,
        "lateral": float((lateral(held.tip_position) @ upward).mean()) / sag,
        "axial": float(((held.tip_position - target.tip_position) @ along).mean()) / sag,
        "model": float((lateral(held.model_tip_position) @ upward).mean()) / sag,
        "tension": float(held.tension.mean(axis=0).max()) / setup.robot.limits.tension_max,
        "command": float(held.command.mean(axis=0).max()) / length,
    }


def similarity(setup: Setup, scales: tuple[float, ...] = SCALES) -> dict[str, float]:
    """Return by how much each of `held_figures` of the scaled robots differs at most from that of the robot, as a share.

    Errors of the tip are shares of the sag already; the others are compared with their own value.
    """
    own = held_figures(scaled_setup(setup, 1.0))
    worst = dict.fromkeys(own, 0.0)
    for k in scales:
        for name, value in held_figures(scaled_setup(setup, k)).items():
            size = 1.0 if name in _SHARES else abs(own[name])
            worst[name] = max(worst[name], abs(value - own[name]) / size)
    return worst
