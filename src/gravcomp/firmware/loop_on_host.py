"""The loop of model and inverse problem on the host, in double precision: what the loop on the board is compared with."""

import dataclasses

import numpy as np

from gravcomp.firmware.model_settings import SAMPLE_PERIOD, LoopParameters
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.inverse import InverseController
from gravcomp.simulation import Simulator

LOADING_STEPS = 50
"""Steps over which gravity rises after a start, on the board as well (GC_LOADING_STEPS), there with the cables' pull."""

APPROACH_STEPS = 400
"""Steps of `turning_gravity` before it turns at its rate."""

_SLOW = np.radians(20.0)  # rad/s, before that


@dataclasses.dataclass(frozen=True)
class HostRun:
    """One row for each step: gravity (n, 3) in m/s^2; wound (n, m) in m before the step; tip (n, 3) in m; command (n, m) in m."""

    gravity: np.ndarray
    wound: np.ndarray
    tip: np.ndarray
    command: np.ndarray


def run_on_host(model: RobotModel, parameters: LoopParameters, gravities: np.ndarray, *, rise: bool = False) -> HostRun:
    """Return the loop's run over gravities (n, 3) from the straight robot with its cables at 0.

    Before that the first one rises from zero over LOADING_STEPS, and the command with it. rise: these steps are rows, too.
    """
    simulator, target = Simulator(model), parameters.at_rest
    controller = InverseController(model.robot, parameters.controller.inverse)
    wound = np.zeros(len(model.robot.cables))
    controller.reset(wound)
    rising = np.arange(1, LOADING_STEPS)[:, None] / LOADING_STEPS * gravities[0]
    rows = []
    for gravity in (*rising, *gravities):
        shape = simulator.step(gravity, wound, duration=SAMPLE_PERIOD)
        command = controller.step(
            shape.response,
            target,
            backbone_station=shape.backbone_station,
            tension=shape.cable_tension,
            interval=SAMPLE_PERIOD,
            followed=shape.is_equilibrium,
        )
        rows.append((gravity, wound, shape.tip_position, command.displacement))
        wound = command.displacement
    return HostRun(*(np.array(column) for column in zip(*rows[0 if rise else len(rising) :])))


def turning_gravity(rate: float, seed: int, steps: int, gravity: float = 9.81) -> np.ndarray:
    """Return gravity (n, 3) in m/s^2 that turns at `rate` (rad/s) about random axes, one a second, for `steps` steps.

    Before that it turns slowly from along the hanging robot to where the path starts, so that a loop starts without a jump.
    """
    rng = np.random.default_rng(seed)
    path = [np.array([0.0, 0.0, -gravity])]
    for step in range(steps + APPROACH_STEPS):
        if step % round(1.0 / SAMPLE_PERIOD) == 0:
            axis = rng.normal(size=3)
            axis /= np.linalg.norm(axis)
        angle = SAMPLE_PERIOD * (rate if step >= APPROACH_STEPS else _SLOW)
        before = path[-1]
        along = axis * (axis @ before)
        path.append(along + np.cos(angle) * (before - along) + np.sin(angle) * np.cross(axis, before))
    return np.array(path)
