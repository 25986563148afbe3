"""What is odd in an IMU stream: units, axes, spikes, calibration, timing; the same checks offline and live.

findings = check_recording(recording)             # a whole recording
monitor = StreamMonitor(); monitor.add(stamp_ns, gyro, accel); monitor.findings()
"""

from gravcomp.stream_checks.counter import CounterStamps
from gravcomp.stream_checks.finding import Finding
from gravcomp.stream_checks.monitor import StreamMonitor
from gravcomp.stream_checks.whole import check_recording, converted, in_si

__all__ = ["CounterStamps", "Finding", "StreamMonitor", "check_recording", "converted", "in_si"]
