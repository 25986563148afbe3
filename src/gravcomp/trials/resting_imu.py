"""Gravity as the orientation filter estimates it on a base at rest: the virtual board alone, read through its CAN frames.

The closed loop gives the same estimate, but computes rod, model and controller for it, whose results are not needed.
"""

import dataclasses

import numpy as np

from gravcomp.canbus.imu_stream import ImuStream
from gravcomp.closed_loop.setup import Setup
from gravcomp.closed_loop.warm_board import warm_heater, with_warm_board
from gravcomp.orientation import GravityEstimator, Problem
from gravcomp.orientation import quaternion as quat
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.virtual.board import STATUS_PERIOD, VirtualBoard
from gravcomp.virtual.imu_chip import SAMPLE_PERIOD

_TIME = 2.0  # s
_AVERAGED = 0.5  # s at the end


def gravity_at_rest(setup: Setup, base: np.ndarray) -> np.ndarray:
    """Return gravity (3,) in soft_base, m/s^2, as estimated in two seconds; base (3, 3): world from soft_base."""
    true = dataclasses.replace(setup, truth=with_warm_board(setup)).true_robot
    board = VirtualBoard(true.board, np.random.default_rng(np.random.SeedSequence(true.seed).spawn(4)[2]))
    mount = setup.robot.imu_mount
    estimator = GravityEstimator(setup.estimator.estimator, quat.from_roll_pitch_yaw(*mount.rpy))
    heater = warm_heater(setup)
    force = mount.rotation.T @ base.T @ np.array([0.0, 0.0, STANDARD_GRAVITY])  # specific force in imu_link
    stream, estimates = ImuStream(), []
    for k in range(round(_TIME / SAMPLE_PERIOD)):
        time = (k + 1) * SAMPLE_PERIOD
        frames = board.sample(np.zeros(3), force, recorded=False)
        if k % round(STATUS_PERIOD / SAMPLE_PERIOD) == 0:
            frames.insert(0, board.status())  # with the ranges of the samples
        for frame in frames:
            sample = stream.on_frame(frame, time)
            if sample is None:
                continue
            stamp_ns = round(1e9 * sample.stamp)
            estimator.add_temperature(stamp_ns, sample.temperature)
            board.command_heater(heater.update(stamp_ns, sample.temperature).duty)
            estimate = estimator.update(stamp_ns, sample.angular_rate, sample.specific_force)
            if not isinstance(estimate, Problem):
                estimates.append(estimate.gravity)
    return np.mean(estimates[-round(_AVERAGED / SAMPLE_PERIOD) :], axis=0)
