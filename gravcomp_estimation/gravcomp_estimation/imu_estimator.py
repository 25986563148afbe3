"""Node imu_estimator: estimates orientation, gravity and bias from the IMU's samples, and controls the IMU's temperature.

The estimate depends only on the stamps and values of the samples. Whatever depends on the arrival of messages (stale streams, the
heater, the status) does not enter it.
"""

import dataclasses
import math
import time
from pathlib import Path

from geometry_msgs.msg import Vector3Stamped
from gravcomp_node.managed_node import ERROR, OK, WARN
from gravcomp_node.serialised_imu import read_sample
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import Imu, Temperature
from std_msgs.msg import Float32
from std_srvs.srv import Trigger

from gravcomp.graph.parameters.imu_estimator import ImuEstimatorParameters
from gravcomp.orientation import BiasModelError, BiasTemperatureModel, GravityEstimate, GravityEstimator, Problem
from gravcomp.orientation import quaternion as quat
from gravcomp.stream_checks import CounterStamps, StreamMonitor
from gravcomp.thermal import HeaterControl
from gravcomp_estimation import messages
from gravcomp_estimation.status import Situation, evaluate
from gravcomp_estimation.stream import SensorStream
from gravcomp_msgs.msg import ImuStatus
from gravcomp_node import COMMAND, LATCHED, SENSOR, ManagedNode, run

STATUS_PERIOD = 0.1  # s, also of imu/heater: the board switches the heater off without commands
FOLLOW_PERIOD = 0.5  # s
SAVE_PERIOD = 60.0  # s
CHECKS_MEMORY = 120.0  # s for which the checks of the stream remember
BIAS_PERIOD_NS = 100_000_000  # of imu/bias, which changes over minutes
KNOWN_AGE_NS = 100_000_000  # between a sample and arm/acceleration; an older acceleration is that of another motion
LEVELS = {ImuStatus.OK: OK, ImuStatus.INITIALISING: OK, ImuStatus.UNCALIBRATED: WARN}


class ImuEstimator(ManagedNode):
    """Estimates orientation, gravity and bias from imu/data_raw; controls the IMU's temperature through imu/heater."""

    name = "imu_estimator"
    parameters_class = ImuEstimatorParameters

    def configure(self) -> None:
        """Create publishers, services, estimator and heater control."""
        self._imu = self.create_publisher(Imu, "imu/data", SENSOR)
        self._gravity = self.create_publisher(Vector3Stamped, "gravity", SENSOR)
        self._bias = self.create_publisher(Vector3Stamped, "imu/bias", SENSOR)
        self._status = self.create_publisher(ImuStatus, "imu/status", LATCHED)
        self._heater_duty = self.create_publisher(Float32, "imu/heater", COMMAND)
        self._reset_service = self.create_service(Trigger, "~/reset", self._on_reset)
        self._reset_bias_service = self.create_service(Trigger, "~/reset_bias", self._on_reset_bias)
        self._make_estimator()
        self._heater = HeaterControl(self.parameters.heater, self._heater.ambient if hasattr(self, "_heater") else None)

    def activate(self) -> None:
        """Reset the estimator and subscribe."""
        self._estimator.reset()
        self._monitor = StreamMonitor(CHECKS_MEMORY)
        self._counter = CounterStamps()
        self._estimate: GravityEstimate | None = None
        self._problem = Problem.NONE
        self._sample_time: float | None = None  # monotonic, s
        self._problem_time: float | None = None
        self._stamp_ns = 0
        self._bias_stamp_ns = 0
        self._period = 0.0
        self._code: int | None = None
        reliability = self.parameters.reliability
        self._streams = [
            SensorStream(self, Imu, "imu/data_raw", self._on_sample, reliability, raw=True),
            SensorStream(self, Temperature, "imu/temperature", self._on_temperature, reliability),
        ]
        self._known, self._known_stamp_ns = (0.0, 0.0, 0.0), 0
        self._known_input = None
        if self.parameters.arm_acceleration:
            self._known_input = self.create_subscription(Vector3Stamped, "arm/acceleration", self._on_acceleration, SENSOR)
        # Steady clock: the status must be published also when the clock of a replay has stopped.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timers_active = [
            self.create_timer(STATUS_PERIOD, self._on_status, clock=steady),
            self.create_timer(FOLLOW_PERIOD, self._follow_streams, clock=steady),
            self.create_timer(SAVE_PERIOD, self._save_bias_model, clock=steady),
        ]

    def deactivate(self) -> None:
        """Unsubscribe, switch the heater off and save the bias model."""
        for stream in self._streams:
            stream.close()
        if self._known_input is not None:
            self.destroy_subscription(self._known_input)
        for timer in self._timers_active:
            self.destroy_timer(timer)
        self._heater_duty.publish(Float32(data=0.0))
        # Latched: late subscribers must not take the last active status for the current one.
        stopped = messages.header(self._stamp_ns, self.parameters.imu_frame)
        self._status.publish(ImuStatus(header=stopped, code=ImuStatus.NO_DATA, message="not active"))
        self._save_bias_model()

    def cleanup(self) -> None:
        """Destroy publishers and services."""
        for service in (self._reset_service, self._reset_bias_service):
            self.destroy_service(service)
        for publisher in (self._imu, self._gravity, self._bias, self._status, self._heater_duty):
            self.destroy_publisher(publisher)

    def parameters_changed(self, old: ImuEstimatorParameters, new: ImuEstimatorParameters) -> None:
        """Apply the parameters; rebuild the filter where a running one cannot take them."""
        if not hasattr(self, "_estimator"):
            return
        self._estimator.set_prediction(new.prediction)
        self._estimator.bias_estimation = new.filter.bias_estimation
        if _rebuilt_for(old) != _rebuilt_for(new):
            self._make_estimator()
            self.get_logger().info("the filter restarts with the changed parameters")
        if old.heater != new.heater:
            self._heater = HeaterControl(new.heater, self._heater.ambient)

    def _make_estimator(self) -> None:
        mount = quat.from_roll_pitch_yaw(*self.robot_file.robot.imu_mount.rpy)
        model = None
        if self.parameters.bias_model_file:
            try:
                model = BiasTemperatureModel.load(self.parameters.bias_model_file)
            except BiasModelError as error:
                self.get_logger().error(f"{error}; continuing without the bias model")
        self._estimator = GravityEstimator(self.parameters.estimator, mount, model)

    # Samples.

    def _on_sample(self, serialised: bytes) -> None:
        now = time.monotonic()
        try:
            stamp, gyro, accel = read_sample(serialised)
        except ValueError as error:
            self.get_logger().warning(f"imu/data_raw: {error}", throttle_duration_sec=1.0)
            return
        self._sample_time = now
        known = self._known if abs(stamp - self._known_stamp_ns) < KNOWN_AGE_NS else (0.0, 0.0, 0.0)
        continued = self._counter.continued(stamp)
        estimate = self._estimator.update(continued, gyro, accel, known)
        problem = estimate if isinstance(estimate, Problem) else estimate.imu.problem
        if problem is not Problem.NONE:
            self._problem, self._problem_time = problem, now
        if isinstance(estimate, Problem):
            self._monitor.add(continued, gyro, accel)
            return
        step = (stamp - self._stamp_ns) * 1e-9
        if 0.0 < step < self.parameters.filter.sensor.largest_gap:
            self._period = step
        self._stamp_ns, self._estimate = stamp, estimate
        parameters = self.parameters
        self._gravity.publish(messages.vector(stamp, parameters.base_frame, estimate.gravity))
        self._monitor.add(continued, gyro, estimate.accel)  # the loop waits for gravity, not for the checks of the stream
        if self._imu.get_subscription_count():
            self._imu.publish(messages.imu_data(estimate, parameters.imu_frame, self._period, parameters.filter))
        if not 0 <= stamp - self._bias_stamp_ns < BIAS_PERIOD_NS:
            self._bias_stamp_ns = stamp
            self._bias.publish(messages.vector(stamp, parameters.imu_frame, estimate.bias))

    def _on_acceleration(self, message: Vector3Stamped) -> None:
        v = message.vector
        if math.isfinite(v.x + v.y + v.z):
            self._known, self._known_stamp_ns = (v.x, v.y, v.z), messages.stamp_ns(message.header)

    def _on_temperature(self, message: Temperature) -> None:
        self._estimator.add_temperature(messages.stamp_ns(message.header) + self._counter.passed, message.temperature)
        self._heater.update(time.monotonic_ns(), message.temperature)

    # Status and heater.

    def _on_status(self) -> None:
        now = time.monotonic()
        sample_age = None if self._sample_time is None else now - self._sample_time
        alive = sample_age is not None and sample_age <= self.parameters.stale_time
        heater = self._heater.check(time.monotonic_ns()) if alive else self._heater.state
        # Without samples the temperature reading may be outdated.
        duty = heater.duty if alive else 0.0
        self._heater_duty.publish(Float32(data=duty))
        code, sentence = evaluate(
            Situation(
                sample_age=sample_age,
                problem=self._problem,
                problem_age=None if self._problem_time is None else now - self._problem_time,
                estimate=self._estimate,
                heater=heater,
                stale_time=self.parameters.stale_time,
                findings=self._monitor.findings(),
            )
        )
        if code != self._code:
            if code in (ImuStatus.OK, ImuStatus.INITIALISING):
                self.get_logger().info(sentence)
            else:
                self.get_logger().warning(sentence)
            self._code = code
        estimate = self._estimate
        status = ImuStatus(
            header=messages.header(self._stamp_ns, self.parameters.imu_frame),
            code=code,
            message=sentence,
            rest=estimate is not None and estimate.imu.rest,
            bias_estimation=self._estimator.bias_estimation,
            temperature_ready=heater.ready,
            temperature=heater.temperature,
            temperature_target=heater.target,
            heater_duty=duty,
            inclination_std=math.nan if estimate is None else estimate.imu.inclination_std,
            rejected=self._estimator.filter.rejected,
        )
        self._status.publish(status)
        self.report(
            LEVELS.get(code, ERROR),
            sentence,
            temperature_c=heater.temperature,
            temperature_ready=heater.ready,
            rest=status.rest,
            rejected=status.rejected,
            counter_wraps=self._counter.wraps,
            stream="; ".join(finding.text for finding in self._monitor.findings()),
            not_shown="; ".join(self._monitor.unknown()),
        )

    def _follow_streams(self) -> None:
        for stream in self._streams:
            stream.follow()

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._estimator.reset()
        self._monitor.reset()
        self._heater.reset()
        self._estimate = None
        response.success, response.message = True, "orientation, bias and heater control restarted"
        return response

    def _on_reset_bias(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._estimator.filter.reset_bias()
        response.success, response.message = True, "bias estimate restarted"
        return response

    def _save_bias_model(self) -> None:
        """Add what this run has learned to the file; not in a replay, which must give the same result each time."""
        file, learned = self.parameters.bias_model_file, self._estimator.learned
        replayed = self.get_parameter("use_sim_time").value or self._streams[0].reliable
        if not file or learned.span is None or replayed:
            return
        try:
            model = BiasTemperatureModel.load(file)
            model.merge(learned)
            model.save(Path(file))
        except (BiasModelError, OSError) as error:
            self.get_logger().error(f"the bias model cannot be saved: {error}")
        else:
            learned.clear()


def _rebuilt_for(parameters: ImuEstimatorParameters) -> tuple:
    """Return the parameters whose change requires a new filter."""
    return dataclasses.replace(parameters.filter, bias_estimation=True), parameters.calibration


def main() -> int:
    """Run the node; return the exit code."""
    return run(ImuEstimator)
