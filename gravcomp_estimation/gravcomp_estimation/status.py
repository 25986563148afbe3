"""IMU status: one code and one sentence, for the most severe of all current problems."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from gravcomp.orientation import GravityEstimate, Problem
from gravcomp.stream_checks import Finding
from gravcomp.thermal import HeaterFault, HeaterState
from gravcomp_msgs.msg import ImuStatus

CONVERGED = math.radians(2.0)  # rad, standard deviation of the inclination
PROBLEM_LASTS = 0.5  # s for which a bad sample is reported


@dataclass(frozen=True)
class Situation:
    """Inputs of the status. Ages are in s; None: it has not happened."""

    sample_age: float | None
    problem: Problem
    problem_age: float | None
    estimate: GravityEstimate | None
    heater: HeaterState
    stale_time: float
    findings: Sequence[Finding] = ()  # of the stream, the worst first


def evaluate(situation: Situation) -> tuple[int, str]:
    """Return the code of ImuStatus and the sentence."""
    if situation.sample_age is None:
        return ImuStatus.NO_DATA, "no sample has been received on imu/data_raw yet"
    if situation.sample_age > situation.stale_time:
        return ImuStatus.NO_DATA, f"no sample on imu/data_raw for {situation.sample_age:.1f} s"
    if situation.problem_age is not None and situation.problem_age < PROBLEM_LASTS:
        return ImuStatus.BAD_DATA, situation.problem.value
    if situation.findings and situation.findings[0].fatal:
        return ImuStatus.BAD_DATA, situation.findings[0].text
    if situation.heater.fault is not HeaterFault.NONE:
        return ImuStatus.HEATER_FAULT, f"heater off: {situation.heater.fault.value}"
    estimate = situation.estimate
    if estimate is None or estimate.imu.inclination_std > CONVERGED:
        return ImuStatus.INITIALISING, "the inclination has not converged yet"
    if not estimate.calibrated:
        norm = estimate.imu.accel_norm_at_rest
        return (
            ImuStatus.UNCALIBRATED,
            f"the specific force at rest is {norm:.2f} m/s^2 and differs from gravity: calibrate the accelerometer",
        )
    state = "at rest" if estimate.imu.rest else "in motion"
    return ImuStatus.OK, "; ".join([state, *(finding.text for finding in situation.findings)])
