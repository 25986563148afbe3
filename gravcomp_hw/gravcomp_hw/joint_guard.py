"""The guard process of joint_bridge for controllers of efforts: it sends zeros when the bridge is killed or blocked.

    python -m gravcomp_hw.joint_guard TOPIC NUMBER NAMESPACE

TOPIC: of the controller, NUMBER: of its joints. Heartbeats come through standard input (`gravcomp.motors.joint_guard`). It prints
a line when it is ready, and then a byte for each time that it has read heartbeats, so that the bridge finds a guard that hangs.
"""

import array
import contextlib
import os
import select
import signal
import sys
import time

import rclpy
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64MultiArray

from gravcomp.canbus.precedence import take_precedence
from gravcomp.motors.joint_guard import BEAT, JointGuard

_PERIOD = 0.01  # s, between two messages of zeros


def main(arguments: list[str]) -> int:
    """Watch until the bridge leaves or has been dead for a while. Returns 0."""
    topic, number, namespace = arguments
    # A Ctrl-C that ends the bridge must not end the guard before it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    rclpy.init(args=[])
    node = rclpy.create_node("joint_guard", namespace=namespace, enable_rosout=False, start_parameter_services=False)
    publisher = node.create_publisher(Float64MultiArray, topic, QoSProfile(depth=10))
    zeros = Float64MultiArray(data=array.array("d", [0.0] * int(number)))
    take_precedence()
    print("ready", flush=True)
    os.set_blocking(1, False)
    guard = JointGuard(time.monotonic())
    open_ = True
    while not guard.done(time.monotonic()):
        if open_ and select.select([0], [], [], _PERIOD)[0]:
            data = os.read(0, 4096)
            open_ = bool(data)
            guard.on_bytes(data, time.monotonic())
            with contextlib.suppress(OSError):  # a bridge that hangs does not read
                os.write(1, BEAT)
        elif not open_:
            time.sleep(_PERIOD)
        if guard.acting(time.monotonic()):
            publisher.publish(zeros)
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
