"""One code and one sentence out of everything that can be wrong at the same time, the gravest first."""

import math
from dataclasses import dataclass

from gravcomp.orientation import GravityEstimate, Problem
from gravcomp.thermal import HeaterFault, HeaterState
from gravcomp_msgs.msg import ImuStatus

CONVERGED = math.radians(2.0)  # of inclination, standard deviation
PROBLEM_LASTS = 0.5  # s: so long a bad sample is spoken of


@dataclass(frozen=True)
class Situation:
    """What the status is told from; ages in s, None: never."""

    sample_age: float | None
    problem: Problem
    problem_age: float | None
    estimate: GravityEstimate | None
    heater: HeaterState
    stale_time: float


def judge(situation: Situation) -> tuple[int, str]:
    """The code of ImuStatus and the sentence."""
    if situation.sample_age is None:
        return ImuStatus.NO_DATA, "no sample has come on imu/data_raw yet"
    if situation.sample_age > situation.stale_time:
        return ImuStatus.NO_DATA, f"no sample on imu/data_raw for {situation.sample_age:.1f} s"
    if situation.problem_age is not None and situation.problem_age < PROBLEM_LASTS:
        return ImuStatus.BAD_DATA, situation.problem.value
    if situation.heater.fault is not HeaterFault.NONE:
        return ImuStatus.HEATER_FAULT, f"heater off: {situation.heater.fault.value}"
    estimate = situation.estimate
    if estimate is None or estimate.imu.inclination_std > CONVERGED:
        return ImuStatus.INITIALISING, "the inclination is not known well enough yet"
    if not estimate.calibrated:
        norm = estimate.imu.accel_norm_at_rest
        return ImuStatus.UNCALIBRATED, f"the specific force at rest is {norm:.2f} m/s^2, not gravity: calibrate the accelerometer"
    return ImuStatus.OK, "at rest" if estimate.imu.rest else "in motion"
