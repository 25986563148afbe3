"""Conversion between samples or estimates and messages; covariances follow REP-145, frames REP-103."""

from geometry_msgs.msg import Vector3, Vector3Stamped
from sensor_msgs.msg import Imu
from std_msgs.msg import Header

from gravcomp.orientation import FilterOptions, GravityEstimate

UNKNOWN = -1.0  # REP-145: first entry of the covariance of a quantity that is not given


def stamp_ns(header: Header) -> int:
    """Return the stamp of a header in ns."""
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def header(stamp: int, frame: str) -> Header:
    """Return a header with a stamp given in ns."""
    message = Header(frame_id=frame)
    message.stamp.sec, message.stamp.nanosec = divmod(stamp, 1_000_000_000)
    return message


def raw_imu(stamp: int, frame: str, gyro: list[float], accel: list[float]) -> Imu:
    """Return the message of a raw sample: rate (3,) in rad/s and specific force (3,) in m/s^2, without orientation."""
    message = Imu(header=header(stamp, frame))
    message.orientation_covariance[0] = UNKNOWN
    message.angular_velocity.x, message.angular_velocity.y, message.angular_velocity.z = gyro
    message.linear_acceleration.x, message.linear_acceleration.y, message.linear_acceleration.z = accel
    return message


def imu_data(estimate: GravityEstimate, frame: str, period: float, options: FilterOptions) -> Imu:
    """Return imu/data: orientation, rate without bias and calibrated specific force, with covariances.

    period: s, of the samples. The covariance of the orientation is about the earth-fixed axes; the one of yaw grows without
    bound, because a six-axis IMU does not observe yaw.
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
    """Return a stamped vector; `stamp` in ns."""
    return Vector3Stamped(header=header(stamp, frame), vector=Vector3(x=value[0], y=value[1], z=value[2]))
