"""Orientation from gyroscope and accelerometer: an error-state extended Kalman filter with nine states.

Nominal state: orientation q (sensor to earth, z up), gyroscope bias b, velocity v (earth). Between samples

    q <- q exp((w - b) dt),    v <- v + (R(q) a - g) dt,

with the rate w, the specific force a and g = (0, 0, g). Error state x = (theta, db, dv), theta in the earth's frame
(R_true = exp(theta) R), in its invariant form (A. Barrau, S. Bonnabel, "The Invariant Extended Kalman Filter as a Stable
Observer", IEEE TAC 2017): the velocity's error depends on theta through gravity alone,

    theta' = -R db,    db' = 0,    dv' = -[g]x theta,

so yaw, which six axes cannot tell, is never corrected. The accelerometer is not taken for gravity: what is measured at
every sample is 'the velocity is about zero', a sensor that moves but stays about; at rest also 'the mean rate is the bias'.
The covariance algebra is filterpy's KalmanFilter on the error state.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.guard import REJECTED, RESTARTED, Problem, SampleGuard, Verdict
from gravcomp.orientation.options import FilterOptions
from gravcomp.orientation.rest import RestDetector, agrees

START_TILT_STD = math.radians(5.0)  # of one accelerometer sample taken for gravity, more where |a| differs from g
START_YAW_STD = math.radians(0.1)  # yaw is zero by definition
START_VELOCITY_STD = 0.5  # m/s
SATURATED_RATE_NOISE = 2.0  # rad/s/sqrt(Hz): faster than the gyroscope can tell
STUCK_RATE_NOISE = 0.3  # rad/s/sqrt(Hz): the gyroscope says nothing, the sensor turns as a hand turns it
UNKNOWN_ACCEL_NOISE = 5.0  # m/s^2/sqrt(Hz): the accelerometer says nothing
CONTRADICTION = 0.5  # m/s: a repeated value that leads to such a velocity is a stuck sensor's, not that of a sensor at rest
CONTRADICTED_TILT = math.radians(
    2.0
)  # at rest between specific force and gravity: more than a calibration to be believed explains
MISSED_PERIODS = 2.5  # a longer step than so many periods: samples are missing
GRAVITY_TIME = 1.0  # s, low-pass of |a| at rest
LARGEST_SCALE = 0.1  # of gravity: how far |a| at rest may be off and still be made good
_UNITY = {size: np.eye(size) for size in (3, 6)}  # of the measurements: velocity, and the bias with it


@dataclass(frozen=True, slots=True)
class Estimate:
    """What is believed after a sample. Orientation and gravity are those at the stamp, the sensor's delay made good."""

    stamp_ns: int
    orientation: quat.Quaternion  # w x y z, sensor to earth
    gravity: tuple[float, float, float]  # m/s^2, sensor frame, pointing down
    angular_velocity: tuple[float, float, float]  # rad/s, sensor frame, without bias
    bias: tuple[float, float, float]  # rad/s
    covariance: np.ndarray  # (9, 9) of (theta, db, dv), earth / sensor / earth frame
    inclination_std: float  # rad, of the direction of gravity, the accelerometer's calibration included
    rest: bool
    accel_norm_at_rest: float | None  # m/s^2, None before the first rest
    problem: Problem


class OrientationFilter:
    """Takes samples by stamp, gives an Estimate for each one that could be used."""

    def __init__(self, options: FilterOptions | None = None):
        from filterpy.kalman import KalmanFilter  # takes a second to import: scipy.stats comes with it

        self.options = options or FilterOptions()
        self.bias_estimation = self.options.bias_estimation
        self.temperature_stable = False  # told from outside: then the bias hardly walks
        self.rejected = 0  # samples not used, since construction
        self._guard = SampleGuard(self.options.sensor)
        self._rest = RestDetector(self.options.rest)
        self._kalman = KalmanFilter(dim_x=9, dim_z=3)
        self._kalman.inv = _inverse
        self._transition = np.eye(9)
        self._process = np.zeros((9, 9))
        self._process_diagonal = self._process.ravel()[::10]
        self._measure_velocity = np.hstack([np.zeros((3, 6)), np.eye(3)])
        self._measure_at_rest = np.vstack([self._measure_velocity, np.hstack([np.zeros((3, 3)), np.eye(3), np.zeros((3, 3))])])
        self._noise_velocity = np.zeros((3, 3))
        self._noise_at_rest = np.zeros((6, 6))
        self._zero = np.zeros((9, 1))
        self._vertical = np.zeros((9, 2))
        self._vertical[2, 1] = 1.0
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next sample starts with yaw 0 and no bias."""
        self._guard.reset()
        self._started = False
        self._orientation = quat.IDENTITY
        self._gravity_norm = self.options.gravity
        self._accel_norm_at_rest: float | None = None
        self._kalman.P = np.zeros((9, 9))
        self.reset_bias()

    def reset_bias(self, bias: Sequence[float] = (0.0, 0.0, 0.0), std: float | None = None) -> None:
        """Begin the bias (rad/s) anew from the given value, with the given standard deviation (rad/s; default `bias_initial`).

        What is given so was told, not seen: the first rest may contradict it, and then it is dropped.
        """
        self._bias = tuple(float(b) for b in bias)
        self._bias_told = std is not None
        self._rest.reset()
        self._set_bias_std(self.options.bias_initial if std is None else std)

    def _set_bias_std(self, std: float) -> None:
        covariance = self._kalman.P
        covariance[3:6, :] = 0.0
        covariance[:, 3:6] = 0.0
        covariance[3:6, 3:6] = np.eye(3) * std**2

    def set_bias_estimation(self, on: bool) -> None:
        """Switch the estimation of the bias on or off while running; off, the bias keeps its value and its uncertainty."""
        self.bias_estimation = on
        covariance = self._kalman.P
        for rows in (slice(0, 3), slice(6, 9)):
            covariance[rows, 3:6] = 0.0
            covariance[3:6, rows] = 0.0
        self._transition[0:3, 3:6] = 0.0
        self._transition[6:8, 3:6] = 0.0

    def update(self, stamp_ns: int, gyro: Sequence[float], accel: Sequence[float]) -> Estimate | Problem:
        """Take the sample: stamp in ns, gyro (3,) rad/s, accel (3,) m/s^2, specific force, both in the sensor's frame.

        Returns the Problem alone when the sample cannot be used.
        """
        gyro = (float(gyro[0]), float(gyro[1]), float(gyro[2]))
        accel = (float(accel[0]), float(accel[1]), float(accel[2]))
        verdict = self._guard.judge(stamp_ns, gyro, accel)
        if verdict.problem in REJECTED:
            self.rejected += 1
            return verdict.problem
        if not self._started or verdict.problem in RESTARTED:
            self._start(gyro, accel, verdict.dt)
            return self._estimate(stamp_ns, gyro, False, verdict.problem)

        dt = verdict.dt
        gyro_usable, accel_usable = self._usable(verdict)
        if gyro_usable and accel_usable:
            deviation = [math.sqrt(v) for v in self._kalman.P.ravel()[30:51:10].tolist()]
            if self._bias_told:
                resting = self._first_rest(dt, gyro, accel, deviation)
            else:
                resting = self._rest.update(dt, gyro, accel, self._bias, deviation)
            # Not asked for a rest: where the inclination is wrong the bias is, too.
            if self._rest.calm and self._contradicted_tilt() > CONTRADICTED_TILT:
                self._set_bias_std(self.options.bias_initial)
                self._start(gyro, tuple(self._rest.mean_accel), dt)
                return self._estimate(stamp_ns, gyro, False, Problem.CONTRADICTED)
        else:
            self._rest.reset()
            resting = False
        self._predict(dt, gyro, accel, gyro_usable, accel_usable)
        if accel_usable:
            self._correct(dt, resting and self.bias_estimation)
        if resting:
            self._learn_gravity(dt)
        return self._estimate(stamp_ns, gyro if gyro_usable else self._bias, resting, verdict.problem)

    def _contradicted_tilt(self) -> float:
        """Angle (rad) between the mean specific force and what the inclination makes of gravity.

        A sensor at rest tells gravity by itself. Samples that were lost in a fast turn, or stamps that were wrong, leave an error that the
        covariance does not know of: corrected with the gain of a filter that is sure of itself, it would stay for a minute.
        """
        x, y, z = quat.rotate(self._orientation, self._rest.mean_accel)
        return math.atan2(math.hypot(x, y), z)

    def _first_rest(self, dt: float, gyro: tuple, accel: tuple, deviation: list[float]) -> bool:
        """Whether the sensor rests, told without the bias, which nothing seen has confirmed yet: it may be that of another board."""
        resting = self._rest.update(dt, gyro, accel, self._bias, (self.options.bias_initial,) * 3)
        if resting:
            self._bias_told = False
            if not agrees(self._rest.mean_gyro, self._bias, deviation):
                self._set_bias_std(self.options.bias_initial)
        return resting

    def _start(self, gyro: tuple, accel: tuple, gap: float) -> None:
        """The inclination from one specific force; yaw and bias go on from before, if there was one."""
        yaw, yaw_variance = 0.0, START_YAW_STD**2
        if self._started:
            yaw = quat.yaw_of(self._orientation)
            yaw_variance = self._kalman.P[2, 2] + (math.dist(self._last_gyro, self._bias) * gap) ** 2
        norm = math.hypot(*accel)
        excess = abs(norm / self._gravity_norm - 1.0)
        tilt_std = math.hypot(START_TILT_STD, excess)
        if norm > 0.0:
            self._orientation = quat.level(accel, yaw)
        bias_covariance = self._kalman.P[3:6, 3:6] + np.eye(3) * self.options.bias_walk**2 * gap
        covariance = np.zeros((9, 9))
        covariance[3:6, 3:6] = bias_covariance
        covariance[[0, 1, 2, 6, 7, 8], [0, 1, 2, 6, 7, 8]] = [tilt_std**2] * 2 + [yaw_variance] + [START_VELOCITY_STD**2] * 3
        self._kalman.P = covariance
        self._velocity = (0.0, 0.0, 0.0)
        self._contradicted = False
        self._rest.reset()
        self._last_gyro = gyro
        self._period = 0.0
        self._started = True

    def _usable(self, verdict: Verdict) -> tuple[bool, bool]:
        """Whether gyroscope and accelerometer are believed: repeated values are, until they contradict one another."""
        stuck = verdict.gyro_stuck or verdict.accel_stuck
        self._contradicted = stuck and (self._contradicted or math.hypot(*self._velocity) > CONTRADICTION)
        gyro = not verdict.gyro_saturated and not (verdict.gyro_stuck and self._contradicted)
        accel = not verdict.accel_saturated and not (verdict.accel_stuck and self._contradicted)
        return gyro, accel

    def _predict(self, dt: float, gyro: tuple, accel: tuple, gyro_usable: bool, accel_usable: bool) -> None:
        options = self.options
        extra_tilt = extra_velocity = 0.0
        rate = gyro if gyro_usable else self._bias
        if self._period and dt > MISSED_PERIODS * self._period:
            # Nothing is known of the missing samples: the mean of the rates around them, as uncertain as they differ.
            rate = tuple(0.5 * (a + b) for a, b in zip(rate, self._last_gyro))
            extra_tilt = (math.dist(rate, self._last_gyro) * dt) ** 2
            extra_velocity = UNKNOWN_ACCEL_NOISE**2 * dt
        else:
            self._period = dt if not self._period else self._period + 0.05 * (dt - self._period)
        self._last_gyro = gyro if gyro_usable else self._bias

        wx, wy, wz = rate[0] - self._bias[0], rate[1] - self._bias[1], rate[2] - self._bias[2]
        half = 0.5 * dt
        middle = quat.multiply(self._orientation, quat.exponential(wx * half, wy * half, wz * half))
        self._orientation = quat.normalised(quat.multiply(self._orientation, quat.exponential(wx * dt, wy * dt, wz * dt)))
        if accel_usable:
            fx, fy, fz = quat.rotate(middle, accel)
            vx, vy, vz = self._velocity
            self._velocity = (vx + fx * dt, vy + fy * dt, vz + (fz - self._gravity_norm) * dt)

        transition = self._transition
        turn = quat.matrix(middle)
        gravity_dt = self._gravity_norm * dt
        if self.bias_estimation:
            transition[0:3, 3:6] = turn * -dt
            transition[6, 3:6] = turn[1] * (-half * gravity_dt)
            transition[7, 3:6] = turn[0] * (half * gravity_dt)
        transition[6, 1] = gravity_dt
        transition[7, 0] = -gravity_dt
        rate_squared = wx * wx + wy * wy + wz * wz
        tilt = (options.gyro_noise**2 + options.gyro_noise_per_rate**2 * rate_squared) * dt + extra_tilt
        if not gyro_usable:
            tilt += (STUCK_RATE_NOISE if self._contradicted else SATURATED_RATE_NOISE) ** 2 * dt
        walk = options.bias_walk_stable if self.temperature_stable else options.bias_walk
        bias = walk**2 * dt if self.bias_estimation else 0.0
        velocity = (options.accel_noise if accel_usable else UNKNOWN_ACCEL_NOISE) ** 2 * dt + extra_velocity
        self._process_diagonal[:] = (tilt, tilt, tilt, bias, bias, bias, velocity, velocity, velocity)
        self._kalman.predict(F=transition, Q=self._process)

    def _correct(self, dt: float, measure_bias: bool) -> None:
        options, kalman = self.options, self._kalman
        velocity_variance = options.velocity_noise**2 / dt
        vx, vy, vz = self._velocity
        if measure_bias:
            mean, bias = self._rest.mean_gyro, self._bias
            residual = np.array(((-vx,), (-vy,), (-vz,), (mean[0] - bias[0],), (mean[1] - bias[1],), (mean[2] - bias[2],)))
            self._noise_at_rest.ravel()[:15:7] = velocity_variance
            self._noise_at_rest.ravel()[21::7] = options.rest_noise**2 / dt
            kalman.update(residual, R=self._noise_at_rest, H=self._measure_at_rest)
        else:
            self._forget_vertical_bias()
            self._noise_velocity.ravel()[::4] = velocity_variance
            kalman.update(np.array(((-vx,), (-vy,), (-vz,))), R=self._noise_velocity, H=self._measure_velocity)
        tx, ty, tz, bx, by, bz, ux, uy, uz = kalman.x.ravel().tolist()
        self._orientation = quat.normalised(quat.multiply(quat.exponential(tx, ty, tz), self._orientation))
        self._bias = (self._bias[0] + bx, self._bias[1] + by, self._bias[2] + bz)
        self._velocity = (vx + ux, vy + uy, vz + uz)
        kalman.x = self._zero
        # Rounding makes the covariance unsymmetric, a little more with every sample.
        kalman.P = 0.5 * (kalman.P + kalman.P.T)

    def _forget_vertical_bias(self) -> None:
        """Take yaw and the bias about the vertical as unrelated to the other errors: they do not show in the velocity.

        What relates them is how the sensor was turned before. In a real motion, whose velocity is no white noise, this little would be
        believed far too much, and the bias would wander off by degrees a second.
        """
        w, x, y, z = self._orientation
        apart = self._vertical  # (9, 2) orthonormal: the bias about earth's z, and yaw
        apart[3:6, 0] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
        # The two stay related to one another and to nothing else, (1 - E E^T) P (1 - E E^T) + E E^T P E E^T: two blocks, so still a
        # covariance.
        covariance = self._kalman.P
        related = apart.T @ covariance
        removed = apart @ (related - (related @ apart) @ apart.T)
        self._kalman.P = covariance - removed - removed.T

    def _learn_gravity(self, dt: float) -> None:
        """An accelerometer whose |a| at rest is not g would seem to accelerate upward for ever."""
        norm = math.hypot(*self._rest.mean_accel)
        previous = norm if self._accel_norm_at_rest is None else self._accel_norm_at_rest
        self._accel_norm_at_rest = previous + dt / (GRAVITY_TIME + dt) * (norm - previous)
        lowest, highest = (1.0 - LARGEST_SCALE) * self.options.gravity, (1.0 + LARGEST_SCALE) * self.options.gravity
        self._gravity_norm = min(max(self._accel_norm_at_rest, lowest), highest)

    def _estimate(self, stamp_ns: int, gyro: tuple, rest: bool, problem: Problem) -> Estimate:
        rate = (gyro[0] - self._bias[0], gyro[1] - self._bias[1], gyro[2] - self._bias[2])
        orientation = self._orientation
        delay = self.options.sensor.delay
        if delay:
            orientation = quat.normalised(
                quat.multiply(orientation, quat.exponential(rate[0] * delay, rate[1] * delay, rate[2] * delay))
            )
        covariance = self._kalman.P.copy()
        variance = covariance[0, 0] + covariance[1, 1] + (self.options.accel_error / self.options.gravity) ** 2
        return Estimate(
            stamp_ns=stamp_ns,
            orientation=orientation,
            gravity=quat.rotate(quat.conjugate(orientation), (0.0, 0.0, -self.options.gravity)),
            angular_velocity=rate,
            bias=self._bias,
            covariance=covariance,
            inclination_std=math.sqrt(variance),
            rest=rest,
            accel_norm_at_rest=self._accel_norm_at_rest,
            problem=problem,
        )


def _inverse(covariance: np.ndarray) -> np.ndarray:
    """As np.linalg.inv, whose checks cost more than the inversion of so small a matrix."""
    from scipy.linalg.lapack import dgesv  # at the first sample, as filterpy

    *_, inverse, failed = dgesv(covariance, _UNITY[len(covariance)])
    if failed:
        raise np.linalg.LinAlgError("the innovation's covariance is singular")
    return inverse
