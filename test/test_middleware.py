"""Reach of the messages: the loopback of this host unless more is asked for, and never shared memory."""

import os
import subprocess
import sys

import pytest

from gravcomp.environment.middleware import middleware, reach
from gravcomp.launcher.domain import reserve_domain

DOMAIN = reserve_domain()
# A process for each node: it prints what it receives from the other, and how its participant is connected.
NODE = """
import os, sys, time, rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node(sys.argv[1])
heard = []
node.create_subscription(String, "words", lambda m: heard.append(m.data), 10)
publisher = node.create_publisher(String, "words", 10)
end = time.monotonic() + 60.0
while time.monotonic() < end and sys.argv[2] not in heard:
    publisher.publish(String(data=sys.argv[1]))
    rclpy.spin_once(node, timeout_sec=0.05)
for _ in range(20):
    publisher.publish(String(data=sys.argv[1]))
    time.sleep(0.05)
inodes = set()
for number in os.listdir("/proc/self/fd"):
    try:
        inodes.add(os.readlink(f"/proc/self/fd/{number}").removeprefix("socket:[").removesuffix("]"))
    except FileNotFoundError:
        pass
bound = {line.split()[1].split(":")[0] for line in open("/proc/self/net/udp") if line.split()[9] in inodes}
shared = any("/dev/shm/fastrtps" in line for line in open("/proc/self/maps"))
print(f"heard {sys.argv[2] in heard}, bound to {sorted(bound)}, shared memory {shared}")
"""
LOOPBACK = "0100007F"


def start(name, other, environment):
    bare = {k: v for k, v in os.environ.items() if not k.startswith(("ROS_AUTOMATIC", "FASTRTPS_", "FASTDDS_", "ROS_STATIC"))}
    return subprocess.Popen(
        [sys.executable, "-c", NODE, name, other],
        env={**bare, "ROS_DOMAIN_ID": DOMAIN, **environment},
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize(
    "peer", [{}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, middleware({})], ids=["any", "localhost", "ours"]
)
def test_a_node_uses_loopback_only_and_reaches_nodes_of_every_range_on_this_host(peer):
    ours, theirs = start("ours", "theirs", middleware({})), start("theirs", "ours", peer)
    said, answer = ours.communicate(timeout=120)[0].strip(), theirs.communicate(timeout=120)[0].strip()
    assert said == f"heard True, bound to ['{LOOPBACK}'], shared memory False"
    assert answer.startswith("heard True")


def test_messages_leave_this_host_only_on_request():
    assert reach(middleware({})) == "LOCALHOST"
    assert reach(middleware({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})) == "LOCALHOST"
    assert reach(middleware({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"})) == "SUBNET"
    assert middleware({"ROS_STATIC_PEERS": "192.168.1.7"})["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert middleware({"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}) == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    assert middleware({"FASTRTPS_DEFAULT_PROFILES_FILE": "mine.xml"}) == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def test_a_process_within_the_environment_keeps_it():
    inner = middleware({})
    assert {**inner, **middleware(inner)} == inner
