"""The node judge: when it begins compensation on a controller that is busy, refuses, or does not answer."""

import os
import time

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from gravcomp_hw.judge import Judge
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import SetBool, Trigger

from gravcomp.config import ConfigError
from gravcomp_msgs.msg import CableState
from gravcomp_node import SENSOR

SHORTEST = ("duration:=5.0", "measure_delay:=false")


class Graph:
    """The judge with a virtual robot that rests, and a controller whose answers the test gives."""

    def __init__(self, *parameters):
        rclpy.init(args=["test", "--ros-args", *(part for p in (*SHORTEST, *parameters) for part in ("-p", p))])
        self.executor = SingleThreadedExecutor()
        self.judge, self.peer = Judge(), rclpy.create_node("peer", use_global_arguments=False)
        self.asked, self.answers = [], {"relax": True, "enable": True}
        self.peer.create_service(SetBool, "inverse_controller/enable", lambda _, answer: self.answer("enable", answer))
        self.peer.create_service(Trigger, "inverse_controller/relax", lambda _, answer: self.answer("relax", answer))
        self.truth = self.peer.create_publisher(PoseStamped, "truth/tip", SENSOR)
        self.cables = self.peer.create_publisher(CableState, "cable/state", SENSOR)
        self.bridge = CableState(state=CableState.ACTIVE)
        self.peer.create_timer(0.02, self.rest)
        self.executor.add_node(self.judge)
        self.peers = SingleThreadedExecutor()
        self.peers.add_node(self.peer)

    def __enter__(self):
        self.judge.start()
        return self

    def __exit__(self, *_):
        self.judge.shut_down()
        for node in (self.judge, self.peer):
            node.destroy_node()
        rclpy.try_shutdown()

    def answer(self, service, answer):
        self.asked.append(service)
        answer.success = self.answers[service]
        answer.message = "" if answer.success else "not now"
        return answer

    def rest(self):
        message = PoseStamped()
        message.header.stamp = self.peer.get_clock().now().to_msg()
        self.truth.publish(message)
        self.cables.publish(self.bridge)

    def run(self, until, busy=lambda: False):
        """Spin both until the condition is met; the peer's services and its motion only while it is not busy."""
        end = time.monotonic() + 60.0
        while not until():
            assert time.monotonic() < end, self.asked
            self.executor.spin_once(timeout_sec=0.01)
            if busy():
                self.rest()
            else:
                self.peers.spin_once(timeout_sec=0.01)


def test_a_busy_controller_is_enabled_after_it_has_released():
    """Both requests would wait for it, and the one to enable be served first: the robot would stay released."""
    with Graph("relax_time:=1.0") as graph:
        graph.run(lambda: graph.judge._begin is not None)
        begin = time.monotonic()
        graph.run(lambda: graph.judge._phase == "compensating", busy=lambda: time.monotonic() - begin < 2.0)
    assert graph.asked == ["relax", "enable"]


def test_a_controller_that_refuses_at_first_is_asked_again():
    with Graph("relax_time:=0.0") as graph:
        graph.answers["enable"] = False
        graph.run(lambda: graph.asked == ["enable"])
        graph.answers["enable"] = True
        graph.run(lambda: graph.judge._phase == "compensating")
    assert graph.asked == ["enable", "enable"]


def test_a_run_without_compensation_has_no_figures():
    with Graph("relax_time:=0.5") as graph:
        graph.answers["enable"] = False
        with pytest.raises(ConfigError, match=r"compensation has not begun: .*_controller/enable: the answer is 'not now'"):
            graph.run(lambda: graph.judge._phase == "done")


def test_a_run_whose_bridge_ends_in_a_fault_has_no_figures():
    with Graph("relax_time:=0.5") as graph:
        graph.run(lambda: graph.judge._phase == "compensating")
        graph.bridge = CableState(state=CableState.FAULT, message="motor 1 is stalled")
        with pytest.raises(ConfigError, match="compensation has ended: the bridge drives no motor: motor 1 is stalled"):
            graph.run(lambda: graph.judge._phase == "done")


def test_a_fault_that_is_over_leaves_the_figures():
    with Graph("relax_time:=0.5") as graph:
        graph.bridge = CableState(state=CableState.FAULT, message="no motor answers")
        graph.run(lambda: graph.judge._phase == "compensating")
        graph.bridge = CableState(state=CableState.ACTIVE)
        graph.run(lambda: graph.judge._phase == "done")
