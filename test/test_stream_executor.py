"""The executor of all nodes: messages, timers and services of one node over real DDS, one callback at a time."""

import functools
import threading
import time

import pytest
import rclpy
from gravcomp_node.executor import StreamExecutor
from gravcomp_node.polled import Polled
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from std_msgs.msg import Int32
from std_srvs.srv import Trigger

QOS = QoSProfile(depth=50)
PATIENCE = 10.0  # s


class Pair:
    """A node under the executor, and another node in a thread that sends to it."""

    def __init__(self):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node, self.peer = (rclpy.create_node(name, context=self.context) for name in ("streaming", "peer"))
        self.executor = StreamExecutor(self.node)
        self._peers = SingleThreadedExecutor(context=self.context)
        self._peers.add_node(self.peer)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self):
        while not self._ending.is_set():
            self._peers.spin_once(0.05)

    def until(self, condition):
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, "nothing came"
            self.executor.spin_once(0.05)

    def connected(self, topic):
        publisher = self.peer.create_publisher(Int32, topic, QOS)
        self.until(lambda: publisher.get_subscription_count() == 1)
        return publisher

    def close(self):
        self._ending.set()
        self._thread.join()
        self._peers.shutdown()
        self.executor.shutdown()
        for node in (self.node, self.peer):
            node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def pair():
    pair = Pair()
    yield pair
    pair.close()


def test_every_message_comes_in_order_to_a_subscription_that_was_made_while_it_ran(pair):
    pair.executor.spin_once(0.0)
    heard = []
    pair.node.create_subscription(Int32, "numbers", lambda message: heard.append(message.data), QOS)
    publisher = pair.connected("numbers")
    for k in range(30):
        publisher.publish(Int32(data=k))
    pair.until(lambda: len(heard) == 30)
    assert heard == list(range(30))


def test_a_destroyed_subscription_receives_nothing_and_the_others_continue(pair):
    first, second = [], []
    gone = pair.node.create_subscription(Int32, "numbers", first.append, QOS)
    pair.node.create_subscription(Int32, "others", second.append, QOS)
    numbers, others = pair.connected("numbers"), pair.connected("others")
    numbers.publish(Int32(data=1))
    pair.until(lambda: first)
    pair.node.destroy_subscription(gone)
    numbers.publish(Int32(data=2))
    others.publish(Int32(data=3))
    pair.until(lambda: second)
    assert [message.data for message in first] == [1]


def test_timers_keep_their_period(pair):
    """In a second in which the machine is not too busy for it."""
    ticks = []
    pair.node.create_timer(0.02, lambda: ticks.append(time.monotonic()))
    pair.until(lambda: len(ticks) > 50 and ticks[-1] - ticks[-51] == pytest.approx(1.0, rel=0.1))


def test_services_are_served_immediately_and_never_during_another_callback(pair):
    inside, together = [], []

    def work(name):
        together.extend(inside)
        inside.append(name)
        time.sleep(0.002)
        inside.remove(name)

    def serve(_, response):
        work("service")
        response.success = True
        return response

    pair.node.create_service(Trigger, "serve", serve)
    pair.node.create_timer(0.003, lambda: work("timer"))
    client = pair.peer.create_client(Trigger, "serve")
    pair.until(client.service_is_ready)
    begin = time.monotonic()
    for _ in range(20):
        answer = client.call_async(Trigger.Request())
        pair.until(answer.done)
        assert answer.result().success
    assert together == []
    assert time.monotonic() - begin < 10.0  # the second thread looks once a second: a shorter time shows that it is woken


@pytest.mark.parametrize("kind", ["message", "service"])
def test_an_error_of_a_callback_ends_the_spinning(pair, kind):
    def fail(*_):
        raise ValueError("of the callback")

    if kind == "message":
        pair.node.create_subscription(Int32, "numbers", fail, QOS)
        provoke = pair.connected("numbers")
        call = functools.partial(provoke.publish, Int32())
    else:
        pair.node.create_service(Trigger, "serve", fail)
        client = pair.peer.create_client(Trigger, "serve")
        pair.until(client.service_is_ready)
        call = functools.partial(client.call_async, Trigger.Request())
    call()
    with pytest.raises(ValueError, match="of the callback"):
        pair.until(lambda: False)


def test_a_polled_subscription_never_calls_back(pair):
    polled = Polled(pair.node, Int32, "numbers", QOS)
    publisher = pair.connected("numbers")
    for k in range(5):
        publisher.publish(Int32(data=k))
    fresh = []
    pair.until(lambda: fresh.extend(polled.take_all()) or len(fresh) == 5)
    assert [received.message.data for received in fresh] == list(range(5))
