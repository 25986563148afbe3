"""The checks over a whole recording, and its conversion by what they found."""

from dataclasses import replace

import numpy as np

from gravcomp.recordings.imu import Recording, RecordingError
from gravcomp.stream_checks.finding import Finding
from gravcomp.stream_checks.monitor import StreamMonitor, block_length


def check_recording(recording: Recording) -> list[Finding]:
    """Return what is odd in the recording, the worst first.

    The sign of the accelerometer cannot be found from the samples alone: with it the whole world is mirrored. It is found from
    a known orientation; without one, a first rest upside down is reported as possible.
    """
    return looked_at(recording)[0]


def looked_at(recording: Recording) -> tuple[list[Finding], list[str]]:
    """Return what is odd in the recording, and what it does not show, a sentence each."""
    monitor, length = StreamMonitor(), block_length(recording.rate)
    for begin in range(0, len(recording), length):
        part = slice(begin, begin + length)
        monitor.add_block(recording.stamp_ns[part], recording.gyro[part], recording.accel[part])
    return [*_of_sign(recording, monitor), *monitor.findings()], monitor.unknown()


def in_si(recording: Recording, *, convert: bool, option: str = "") -> tuple[Recording, list[Finding], list[str]]:
    """Return the recording in rad/s, m/s^2 and right-handed axes, what is odd, and what it does not show.

    convert: as far as the findings say how; option: of the command, which converts. Raises RecordingError for wrong units without
    `convert`, and for those that cannot be converted.
    """
    findings, unknown = looked_at(recording)
    for finding in findings:
        if finding.fatal and not (convert and finding.convertible):
            by_option = f", or let {option} do it" if option else ""
            way = f"; convert the recording{by_option}" if finding.convertible else ""
            raise RecordingError(f"{recording.source}: {finding.text}{way}")
    return (converted(recording, findings) if convert else recording), findings, unknown


def converted(recording: Recording, findings: list[Finding]) -> Recording:
    """Return the recording in rad/s, m/s^2 and right-handed axes, as far as the findings say how."""
    gyro, accel = recording.gyro, recording.accel
    for finding in findings:
        if finding.accel_factor is not None:
            accel = accel * finding.accel_factor
    matrices = [finding.gyro_matrix for finding in findings if finding.gyro_matrix is not None]
    if matrices:
        gyro = gyro @ matrices[0].T
    return replace(recording, gyro=gyro, accel=accel)


def _of_sign(recording: Recording, monitor: StreamMonitor) -> list[Finding]:
    if recording.orientation is None:
        if monitor.starts_upside_down:
            text = (
                "the first rest is upside down (-z up): so it is mounted, or gravity is reported in place of the specific force"
            )
            return [Finding("upside_down", text)]
        return []
    w, x, y, z = recording.orientation.T
    up = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)  # in the sensor's frame
    along = np.sum(up * recording.accel, axis=1) / np.linalg.norm(recording.accel, axis=1)
    if np.isfinite(along).any() and np.nanmedian(along) < -0.5:
        text = "the accelerometer is negated: it reports gravity, and the specific force (up at rest) is needed"
        return [Finding("accel_negated", text, accel_factor=-1.0)]
    return []
