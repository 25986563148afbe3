"""The probe of a running graph: what it finds of a graph that it discovers late, as on a busy machine."""

import os
import threading

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))

import rclpy
from sensor_msgs.msg import Imu

from gravcomp_hw import graph_probe
from gravcomp_node import SENSOR

LATE = 5.0  # s


def test_a_topic_that_is_discovered_late_has_its_rate(monkeypatch):
    monkeypatch.setattr(graph_probe, "_LISTEN", 1.0)
    rclpy.init()
    try:
        probe, over = graph_probe.GraphProbe(), threading.Event()
        name = next(name for name, port in probe._ports.items() if port.type == "sensor_msgs/msg/Imu")
        publishing = threading.Thread(target=publish, args=[name, over])
        publishing.start()
        found = {finding.subject: finding for finding in probe.examine()}
        over.set()
        publishing.join()
        assert " Hz of " in found[name].found, found[name]
    finally:
        rclpy.try_shutdown()


def publish(name: str, over: threading.Event) -> None:
    node = rclpy.create_node("late", use_global_arguments=False)
    over.wait(LATE)
    publisher = node.create_publisher(Imu, name, SENSOR)
    while not over.wait(0.01):
        publisher.publish(Imu())
