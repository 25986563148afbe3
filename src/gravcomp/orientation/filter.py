"""Orientation from gyroscope and accelerometer: an error-state extended Kalman filter with nine states.

Nominal state: orientation q (sensor to earth, z up), gyroscope bias b, velocity v (earth). Between samples

    q <- q exp((w - b) dt),    v <- v + (R(q) a - g) dt,

with the rate w, the specific force a and g = (0, 0, g). error_covariance.py holds the error state and its corrections. Six axes
cannot measure yaw, so yaw is never corrected. The accelerometer is not taken for gravity: the measurement at every sample is 'the
velocity is about zero', because the sensor moves but stays near one place; at rest 'the mean rate is the bias' is measured, too.
"""

import math
from collections.abc import Sequence

import numpy as np

from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.alignment import SWING, Alignment, Earlier
from gravcomp.orientation.error_covariance import ErrorCovariance
from gravcomp.orientation.estimate import Estimate
from gravcomp.orientation.even_steps import EvenSteps
from gravcomp.orientation.guard import REJECTED, RESTARTED, Problem, SampleGuard, Verdict
from gravcomp.orientation.last_steps import LastSteps, Step
from gravcomp.orientation.options import FilterOptions
from gravcomp.orientation.rest import RestDetector, agrees
from gravcomp.orientation.swings import Swings
from gravcomp.orientation.vibration import Vibration

START_TILT_STD = math.radians(5.0)  # of one accelerometer sample taken for gravity; larger where |a| differs from g
START_YAW_STD = math.radians(0.1)  # yaw is zero by definition
START_VELOCITY_STD = 0.5  # m/s
SATURATED_RATE_NOISE = 2.0  # rad/s/sqrt(Hz): the sensor turns faster than the gyroscope can measure
STUCK_RATE_NOISE = 0.3  # rad/s/sqrt(Hz): the gyroscope measures nothing, the sensor turns as a hand turns it
UNKNOWN_ACCEL_NOISE = 5.0  # m/s^2/sqrt(Hz): the accelerometer measures nothing
CONTRADICTION = 0.5  # m/s: repeated values that lead to this velocity are those of a stuck sensor, not of a sensor at rest
# Between the mean specific force at rest and the filter's gravity: a larger angle is more than a calibration error explains.
CONTRADICTED_TILT = math.radians(2.0)
MISSED_PERIODS = 2.5  # a step longer than this many periods: samples are missing
GRAVITY_TIME = 1.0  # s, low-pass of |a| at rest
LARGEST_SCALE = 0.1  # of gravity: largest error of |a| at rest that is compensated


class OrientationFilter:
    """Takes samples by stamp and returns an Estimate for each one that can be used."""

    def __init__(self, options: FilterOptions | None = None):
        """Start without orientation; the first sample gives the inclination."""
        self.options = options or FilterOptions()
        self.bias_estimation = self.options.bias_estimation
        self.temperature_stable = False  # set by the caller; while True the bias hardly walks
        self.rejected = 0  # samples not used, since construction
        self._guard = SampleGuard(self.options.sensor)
        self._even = EvenSteps()
        self._rest = RestDetector(self.options.rest)
        self._steps = LastSteps(self.options.spikes)
        self._errors = ErrorCovariance()
        self._alignment = Alignment()
        self._swings, self._vibration = Swings(), Vibration(means=3)  # of the rate, of the specific force
        self.reset()

    def reset(self) -> None:
        """Reset all state: the next sample starts with yaw 0 and no bias."""
        self._guard.reset()
        self._even.reset()
        self._alignment.reset()
        self._swings.reset()
        self._vibration.reset()
        self._started = False
        self._orientation = quat.IDENTITY
        self._velocity = (0.0, 0.0, 0.0)
        self._last_gyro = (0.0, 0.0, 0.0)
        self._contradicted = False
        self._period = 0.0
        self._gravity_norm = self.options.gravity
        self._accel_norm_at_rest: float | None = None
        self._errors.reset(np.zeros((9, 9)))
        self._steps.reset()
        self.reset_bias()

    def reset_bias(self, bias: Sequence[float] = (0.0, 0.0, 0.0), std: float | None = None) -> None:
        """Set the bias (3,) rad/s and its standard deviation (rad/s; default `bias_initial`).

        A bias with a given standard deviation is not measured by this run: if the first rest contradicts it, it is dropped.
        """
        self._bias = (float(bias[0]), float(bias[1]), float(bias[2]))
        self._bias_given = std is not None
        self._steps.forget()
        self._rest.reset()
        self._errors.set_bias_std(self.options.bias_initial if std is None else std)

    def set_bias_estimation(self, on: bool) -> None:
        """Switch the estimation of the bias on or off while running; off, the bias keeps its value and its uncertainty."""
        self.bias_estimation = on
        self._steps.forget()
        self._errors.decouple_bias()

    def update(self, stamp_ns: int, gyro: Sequence[float], accel: Sequence[float]) -> Estimate | Problem:
        """Take a sample and return the estimate, or only the Problem when the sample cannot be used.

        stamp_ns: ns; gyro (3,) rad/s; accel (3,) m/s^2, the specific force; both in the sensor's frame.
        """
        rate = (float(gyro[0]), float(gyro[1]), float(gyro[2]))
        force = (float(accel[0]), float(accel[1]), float(accel[2]))
        verdict = self._guard.check(stamp_ns, rate, force)
        if verdict.problem in REJECTED:
            self.rejected += 1
            return verdict.problem
        if not self._started or verdict.problem in RESTARTED:
            self._start(rate, force, verdict.dt)
            self._alignment.begin(force, self._gravity_norm)
            self._set_aligned()
            self._even.reset()
            self._steps.reset()
            return self._estimate(stamp_ns, rate, False, verdict.problem)

        step = Step(self._even.take(verdict.dt), rate, force, *self._usable(verdict))
        repeated = self._steps.take(step, gap=self._is_gap(step.dt))
        if repeated:
            self._restore(repeated[0][0])
            for _, earlier in repeated:
                self._steps.keep(self._saved(), earlier)
                self._advance(earlier)
        self._steps.keep(self._saved(), step)
        resting = self._advance(step)
        if resting is None:
            self._steps.reset()
            return self._estimate(stamp_ns, step.rate, False, Problem.CONTRADICTED)
        return self._estimate(stamp_ns, step.rate if step.gyro_usable else self._bias, resting, verdict.problem)

    def _advance(self, step: Step) -> bool | None:
        """Take a step into the state. Return whether the sensor rests, None where its rest contradicts the inclination."""
        dt, rate, force = step.dt, step.rate, step.force
        if step.gyro_usable and step.accel_usable:
            deviation = self._errors.bias_std()
            if self._bias_given:
                resting = self._first_rest(dt, rate, force, deviation)
            else:
                resting = self._rest.update(dt, rate, force, self._bias, deviation)
            # `calm` and not `resting`: where the inclination is wrong, the bias is wrong, too.
            if self._rest.calm and self._contradicted_tilt() > CONTRADICTED_TILT:
                self._errors.set_bias_std(self.options.bias_initial)
                ax, ay, az = self._rest.mean_accel
                self._start(rate, (ax, ay, az), dt)
                return None
        else:
            self._rest.reset()
            resting = False
        missing, variance = self._is_gap(dt) and step.accel_usable, self._errors.matrix[0, 0]
        self._predict(step)
        if step.gyro_usable and step.accel_usable:
            self._alignment.watch(dt, force, self.options.gravity)
        broken = self._alignment.active and dt > SWING
        if missing and (broken or self._errors.matrix[0, 0] > 2.0 * variance):  # it is mostly that of the gap
            self._align_anew(force)
            self._set_aligned()
            return resting
        if self._alignment.active and step.gyro_usable:
            noise = math.sqrt(self._vibration.density) if step.accel_usable else UNKNOWN_ACCEL_NOISE
            turn = self._unbiased(rate)
            self._alignment.take(dt, turn, force, self._gravity_norm, noise, self._turn_variance(dt, turn))
            self._set_aligned()
            return resting
        if self._alignment.active:
            self._align_anew(force)
        if step.accel_usable:
            self._correct(dt, resting and self.bias_estimation)
        if resting:
            self._learn_gravity(dt)
        return resting

    def _align_anew(self, force: quat.Vector) -> None:
        """Begin the alignment with the inclination of the state, as sure as that is."""
        upward = quat.rotate(quat.conjugate(self._orientation), (0.0, 0.0, 1.0))
        earlier = Earlier(upward, float(self._errors.matrix[0, 0]), max(self._errors.bias_std()) ** 2)
        self._alignment.begin(force, self._gravity_norm, earlier)

    def _unbiased(self, rate: quat.Vector) -> quat.Vector:
        x, y, z = (w - b for w, b in zip(rate, self._bias))
        return x, y, z

    def _saved(self) -> tuple:
        """Return the state that steps change, for `_restore`."""
        state = (self._orientation, self._velocity, self._bias, self._bias_given, self._last_gyro, self._period)
        learned = (self._gravity_norm, self._accel_norm_at_rest, self._errors.matrix.copy())
        parts = (self._rest, self._alignment, self._swings, self._vibration)
        return *state, *learned, *(part.saved() for part in parts)

    def _restore(self, state: tuple) -> None:
        self._orientation, self._velocity, self._bias, self._bias_given, self._last_gyro, self._period = state[:6]
        self._gravity_norm, self._accel_norm_at_rest = state[6:8]
        self._errors.reset(state[8].copy())
        self._rest.restore(state[9])
        self._alignment.restore(state[10])
        self._swings.restore(state[11])
        self._vibration.restore(state[12])

    def _contradicted_tilt(self) -> float:
        """Return the angle (rad) between the mean specific force and the vertical of the estimated orientation.

        A sensor at rest measures gravity directly. Samples lost in a fast turn, or wrong stamps, cause an error that the
        covariance does not include. With the gain that belongs to that covariance the error would remain for a minute.
        """
        x, y, z = quat.rotate(self._orientation, self._rest.mean_accel)
        return math.atan2(math.hypot(x, y), z)

    def _first_rest(self, dt: float, gyro: quat.Vector, accel: quat.Vector, deviation: list[float]) -> bool:
        """Return whether the sensor rests, evaluated without the given bias, which may be that of another board.

        A bias that the rest contradicts is dropped.
        """
        resting = self._rest.update(dt, gyro, accel, self._bias, (self.options.bias_initial,) * 3)
        if resting:
            self._bias_given = False
            if not agrees(self._rest.mean_gyro, self._bias, deviation):
                self._errors.set_bias_std(self.options.bias_initial)
        return resting

    def _start(self, gyro: quat.Vector, accel: quat.Vector, gap: float) -> None:
        """Start with the inclination from one specific force; yaw and bias continue where there was an orientation before."""
        yaw, yaw_variance = 0.0, START_YAW_STD**2
        before = self._errors.matrix
        if self._started:
            yaw = quat.yaw_of(self._orientation)
            yaw_variance = before[2, 2] + (math.dist(self._last_gyro, self._bias) * gap) ** 2
        norm = math.hypot(*accel)
        excess = abs(norm / self._gravity_norm - 1.0)
        tilt_std = math.hypot(START_TILT_STD, excess)
        if norm > 0.0:
            self._orientation = quat.level(accel, yaw)
        covariance = np.zeros((9, 9))
        covariance[3:6, 3:6] = before[3:6, 3:6] + np.eye(3) * self.options.bias_walk**2 * gap
        covariance[[0, 1, 2, 6, 7, 8], [0, 1, 2, 6, 7, 8]] = [tilt_std**2] * 2 + [yaw_variance] + [START_VELOCITY_STD**2] * 3
        self._errors.reset(covariance)
        self._velocity = (0.0, 0.0, 0.0)
        self._contradicted = False
        self._rest.reset()
        self._alignment.active = False
        self._swings.interrupt()
        self._vibration.interrupt()
        self._last_gyro = gyro
        self._period = 0.0
        self._started = True

    def _is_gap(self, dt: float) -> bool:
        """Return whether samples are missing in a step of `dt` s."""
        return self._period > 0.0 and dt > MISSED_PERIODS * self._period

    def _set_aligned(self) -> None:
        """Set the inclination to that of the alignment, with its uncertainty."""
        upward, tilt_std = self._alignment.inclination(self._gravity_norm)
        x, y, z = quat.rotate(self._orientation, upward)
        across = math.hypot(x, y)
        if across > 0.0:
            tilt = math.atan2(across, z) / across
            self._orientation = quat.normalised(quat.multiply(quat.exponential(tilt * y, -tilt * x, 0.0), self._orientation))
        self._velocity, velocity_std, together = (0.0, 0.0, 0.0), START_VELOCITY_STD, 0.0
        if not self._alignment.active:
            motion, velocity_std, together = self._alignment.motion(self._gravity_norm)
            self._velocity = quat.rotate(self._orientation, motion)
        self._errors.set_tilt_and_velocity_std(tilt_std, velocity_std, together)

    def _usable(self, verdict: Verdict) -> tuple[bool, bool]:
        """Return whether gyroscope and accelerometer can be used: repeated values can, unless they contradict each other."""
        stuck = verdict.gyro_stuck or verdict.accel_stuck
        self._contradicted = stuck and (self._contradicted or math.hypot(*self._velocity) > CONTRADICTION)
        gyro = not verdict.gyro_saturated and not (verdict.gyro_stuck and self._contradicted)
        accel = not verdict.accel_saturated and not (verdict.accel_stuck and self._contradicted)
        return gyro, accel

    def _predict(self, step: Step) -> None:
        options = self.options
        dt, gyro, accel, gyro_usable, accel_usable = step.dt, step.rate, step.force, step.gyro_usable, step.accel_usable
        extra_tilt = extra_velocity = 0.0
        wx, wy, wz = self._unbiased(gyro) if gyro_usable else (0.0, 0.0, 0.0)
        if self._is_gap(dt):
            (wx, wy, wz), extra_tilt = self._swings.across(dt, self._period, (wx, wy, wz), step.doubt)
            extra_velocity = UNKNOWN_ACCEL_NOISE**2 * dt
            self._swings.interrupt()
            self._vibration.interrupt()
        else:
            self._period = dt if not self._period else self._period + 0.05 * (dt - self._period)
        if gyro_usable:
            self._swings.watch(dt, self._unbiased(gyro))
        if accel_usable:
            self._vibration.take(dt, accel)
        self._last_gyro = gyro if gyro_usable else self._bias
        half = 0.5 * dt
        middle = quat.multiply(self._orientation, quat.exponential(wx * half, wy * half, wz * half))
        self._orientation = quat.normalised(quat.multiply(self._orientation, quat.exponential(wx * dt, wy * dt, wz * dt)))
        if accel_usable:
            fx, fy, fz = quat.rotate(middle, accel)
            vx, vy, vz = self._velocity
            self._velocity = (vx + fx * dt, vy + fy * dt, vz + (fz - self._gravity_norm) * dt)

        tilt = self._turn_variance(dt, (wx, wy, wz)) + extra_tilt
        if not gyro_usable:
            tilt += (STUCK_RATE_NOISE if self._contradicted else SATURATED_RATE_NOISE) ** 2 * dt
        walk = options.bias_walk_stable if self.temperature_stable else options.bias_walk
        # The velocity is a sum of samples: it has their noise where that is more than the data sheet says.
        force_noise = max(options.accel_noise**2, self._vibration.density) if accel_usable else UNKNOWN_ACCEL_NOISE**2
        self._errors.predict(
            dt,
            middle,
            self._gravity_norm,
            tilt=tilt,
            bias=walk**2 * dt if self.bias_estimation else 0.0,
            velocity=force_noise * dt + extra_velocity,
            bias_estimation=self.bias_estimation,
        )

    def _turn_variance(self, dt: float, rate: quat.Vector) -> float:
        """Return the variance on each axis of a turn by a measured rate (3,) rad/s for `dt` s, rad^2."""
        options, (x, y, z) = self.options, rate
        return (options.gyro_noise**2 + options.gyro_noise_per_rate**2 * (x * x + y * y + z * z)) * dt

    def _correct(self, dt: float, measure_bias: bool) -> None:
        options = self.options
        velocity_variance = options.velocity_noise**2 / dt
        vx, vy, vz = self._velocity
        if measure_bias:
            mean, bias = self._rest.mean_gyro, self._bias
            residual = (mean[0] - bias[0], mean[1] - bias[1], mean[2] - bias[2])
            error = self._errors.correct_at_rest(self._velocity, residual, velocity_variance, options.rest_noise**2 / dt)
        else:
            error = self._errors.correct_velocity(self._velocity, velocity_variance, self._orientation)
        tx, ty, tz, bx, by, bz, ux, uy, uz = error
        self._orientation = quat.normalised(quat.multiply(quat.exponential(tx, ty, tz), self._orientation))
        self._bias = (self._bias[0] + bx, self._bias[1] + by, self._bias[2] + bz)
        self._velocity = (vx + ux, vy + uy, vz + uz)

    def _learn_gravity(self, dt: float) -> None:
        """Learn |a| at rest: if it were not g, the sensor would seem to accelerate along the vertical all the time."""
        norm = math.hypot(*self._rest.mean_accel)
        previous = norm if self._accel_norm_at_rest is None else self._accel_norm_at_rest
        self._accel_norm_at_rest = previous + dt / (GRAVITY_TIME + dt) * (norm - previous)
        lowest, highest = (1.0 - LARGEST_SCALE) * self.options.gravity, (1.0 + LARGEST_SCALE) * self.options.gravity
        self._gravity_norm = min(max(self._accel_norm_at_rest, lowest), highest)

    def _estimate(self, stamp_ns: int, gyro: quat.Vector, rest: bool, problem: Problem) -> Estimate:
        rate = (gyro[0] - self._bias[0], gyro[1] - self._bias[1], gyro[2] - self._bias[2])
        orientation = self._orientation
        delay = self.options.sensor.delay
        if delay:
            orientation = quat.normalised(
                quat.multiply(orientation, quat.exponential(rate[0] * delay, rate[1] * delay, rate[2] * delay))
            )
        covariance = self._errors.matrix.copy()
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
