"""From samples and estimates to messages and back. Covariances and frames as REP-145 and REP-103 have them."""

from geometry_msgs.msg import Vector3, Vector3Stamped
from sensor_msgs.msg import Imu
from std_msgs.msg import Header

from gravcomp.orientation import FilterOptions, GravityEstimate

UNKNOWN = -1.0  # REP-145: first entry of a covariance whose quantity is not given


def stamp_ns(header: Header) -> int:
    """The header's stamp, ns."""
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def header(stamp: int, frame: str) -> Header:
    """A header with the stamp in ns."""
    message = Header(frame_id=frame)
    message.stamp.sec, message.stamp.nanosec = divmod(stamp, 1_000_000_000)
    return message


def sample_of(message: Imu) -> tuple[int, tuple, tuple]:
    """Stamp in ns, rate (3,) rad/s, specific force (3,) m/s^2."""
    rate, accel = message.angular_velocity, message.linear_acceleration
    return stamp_ns(message.header), (rate.x, rate.y, rate.z), (accel.x, accel.y, accel.z)


def raw_imu(stamp: int, frame: str, gyro: list[float], accel: list[float]) -> Imu:
    """A raw sample, without orientation."""
    message = Imu(header=header(stamp, frame))
    message.orientation_covariance[0] = UNKNOWN
    message.angular_velocity.x, message.angular_velocity.y, message.angular_velocity.z = gyro
    message.linear_acceleration.x, message.linear_acceleration.y, message.linear_acceleration.z = accel
    return message


def imu_data(estimate: GravityEstimate, frame: str, period: float, options: FilterOptions) -> Imu:
    """imu/data: orientation, rate without bias and calibrated specific force with covariances; `period` of the samples, s.

    The orientation's covariance is about the earth's fixed axes; that of yaw grows without bound, as six axes do not tell it.
    """
    imu = estimate.imu
    message = Imu(header=header(imu.stamp_ns, frame))
    q = message.orientation
    q.w, q.x, q.y, q.z = imu.orientation
    message.angular_velocity.x, message.angular_velocity.y, message.angular_velocity.z = imu.angular_velocity
    message.linear_acceleration.x, message.linear_acceleration.y, message.linear_acceleration.z = estimate.accel
    rate = 1.0 / period if period > 0.0 else 0.0
    tilt_floor = 0.5 * (options.accel_error / options.gravity) ** 2
    orientation, bias = imu.covariance[:3, :3].ravel().tolist(), imu.covariance[3:6, 3:6].ravel().tolist()
    orientation[0] += tilt_floor
    orientation[4] += tilt_floor
    for i in (0, 4, 8):
        bias[i] += options.gyro_noise**2 * rate
    accel = options.accel_error**2 + options.accel_noise**2 * rate
    message.orientation_covariance[:] = orientation
    message.angular_velocity_covariance[:] = bias
    message.linear_acceleration_covariance[:] = (accel, 0.0, 0.0, 0.0, accel, 0.0, 0.0, 0.0, accel)
    return message


def vector(stamp: int, frame: str, value: tuple[float, float, float]) -> Vector3Stamped:
    """A stamped vector."""
    return Vector3Stamped(header=header(stamp, frame), vector=Vector3(x=value[0], y=value[1], z=value[2]))
