"""Topics between nodes of one process: messages arrive as objects, others get them as well, publishers elsewhere are heard."""

import time

import pytest
import rclpy
from gravcomp_node.executor import StreamExecutor
from gravcomp_node.local_topics import Adapted, LocalPublisher, LocalTopics
from gravcomp_node.polled import Polled
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from std_msgs.msg import Int32

from gravcomp_node import local_topics

QOS = QoSProfile(depth=5)
PATIENCE = 10.0  # s


class Process:
    """Two nodes with one executor, and a node elsewhere, which has a context of its own."""

    def __init__(self):
        self.contexts = [rclpy.Context(), rclpy.Context()]
        for context in self.contexts:
            rclpy.init(context=context)
        self.first, self.second = (rclpy.create_node(name, context=self.contexts[0]) for name in ("first", "second"))
        self.elsewhere = rclpy.create_node("elsewhere", context=self.contexts[1])
        self.outside = rclpy.executors.SingleThreadedExecutor(context=self.contexts[1])
        self.outside.add_node(self.elsewhere)
        self.local = LocalTopics()
        self.executor = StreamExecutor(self.first, self.second, local=self.local)

    def publisher(self, node, topic, qos=QOS):
        publisher = node.create_publisher(Int32, topic, qos, publisher_class=LocalPublisher)
        self.local.add_publisher(node, publisher)
        return publisher

    def subscribe(self, node, topic, callback, qos=QOS, takes=None):
        subscription = node.create_subscription(Int32, topic, callback, qos)
        self.local.add_subscription(node, subscription, callback, takes)
        return subscription

    def until(self, condition, what="nothing came"):
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, what
            self.executor.spin_once(0.01)
            self.outside.spin_once(0.01)

    def close(self):
        self.executor.shutdown()
        self.outside.shutdown()
        for node in (self.first, self.second, self.elsewhere):
            node.destroy_node()
        for context in self.contexts:
            rclpy.shutdown(context=context)


@pytest.fixture
def process(monkeypatch):
    monkeypatch.setattr(local_topics, "FOLLOW_PERIOD", 0.0)
    process = Process()
    yield process
    process.close()


def test_a_message_arrives_as_the_object_and_is_not_serialised(process, monkeypatch):
    serialised, heard = [], []
    monkeypatch.setattr(Publisher, "publish", lambda self, message: serialised.append(message))
    process.subscribe(process.second, "numbers", heard.append)
    publisher = process.publisher(process.first, "numbers")
    message = Int32(data=7)
    publisher.publish(message)
    assert heard == [message] and heard[0] is message and serialised == []
    process.until(lambda: publisher.get_subscription_count() == 1)  # other processes see the subscription
    publisher.publish(Int32())
    assert serialised == [] and len(heard) == 2


def test_a_value_arrives_as_it_is_and_becomes_a_message_only_for_those_who_need_one(process):
    values, messages, there, made = [], [], [], []

    def to_message(value):
        made.append(value)
        return Int32(data=int(value))

    process.subscribe(process.second, "numbers", lambda _: pytest.fail("it takes values"), takes=values.append)
    publisher = process.publisher(process.first, "numbers")
    publisher.publish(Adapted("7", to_message))
    assert values == ["7"] and made == []
    process.subscribe(process.second, "numbers", messages.append)
    process.elsewhere.create_subscription(Int32, "numbers", there.append, QOS)
    process.until(lambda: publisher.get_subscription_count() == 3)
    publisher.publish(Adapted("8", to_message))
    process.until(lambda: there)
    assert values == ["7", "8"] and [m.data for m in messages + there] == [8, 8] and made == ["8"]


def test_a_value_is_published_as_a_message_by_a_node_that_is_alone(process):
    there = []
    publisher = process.first.create_publisher(Int32, "numbers", QOS, publisher_class=LocalPublisher)
    process.elsewhere.create_subscription(Int32, "numbers", there.append, QOS)
    process.until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(Adapted("3", lambda value: Int32(data=int(value))))
    process.until(lambda: there)
    assert there[0].data == 3


def test_the_middleware_gets_the_bytes_of_a_value_that_has_them(process):
    values, messages, there = [], [], []
    process.subscribe(process.second, "numbers", lambda _: pytest.fail("it takes values"), takes=values.append)
    process.subscribe(process.second, "numbers", messages.append)
    publisher = process.publisher(process.first, "numbers")
    process.elsewhere.create_subscription(Int32, "numbers", there.append, QOS)
    process.until(lambda: publisher.get_subscription_count() == 3)
    publisher.publish(
        Adapted("3", lambda value: Int32(data=int(value)), lambda value: serialize_message(Int32(data=10 * int(value))))
    )
    process.until(lambda: there)
    assert values == ["3"] and messages[0].data == 3 and there[0].data == 30


def test_a_subscriber_elsewhere_receives_as_well(process):
    here, there = [], []
    process.subscribe(process.second, "numbers", here.append)
    publisher = process.publisher(process.first, "numbers")
    process.elsewhere.create_subscription(Int32, "numbers", there.append, QOS)
    process.until(lambda: publisher.get_subscription_count() == 2)
    for k in range(3):
        publisher.publish(Int32(data=k))
    process.until(lambda: len(there) == 3)
    assert [m.data for m in there] == [m.data for m in here] == [0, 1, 2]


def test_a_publisher_elsewhere_is_heard_and_no_message_comes_twice(process):
    heard = []
    subscription = process.subscribe(process.second, "numbers", lambda message: heard.append(message.data))
    publisher = process.publisher(process.first, "numbers")
    other = process.elsewhere.create_publisher(Int32, "numbers", QOS)
    process.until(lambda: not process.local.is_local(subscription) and other.get_subscription_count() == 1)
    publisher.publish(Int32(data=1))
    process.until(lambda: heard == [1])
    other.publish(Int32(data=2))
    process.until(lambda: heard == [1, 2])
    process.elsewhere.destroy_publisher(other)
    process.until(lambda: process.local.is_local(subscription), "it stays with the middleware")
    publisher.publish(Int32(data=3))
    assert heard == [1, 2, 3]
    process.executor.spin_once(0.2)
    assert heard == [1, 2, 3]


def test_nodes_that_answer_each_other_do_not_call_back_while_they_publish(process):
    order = []
    back = process.publisher(process.second, "back")
    there = process.publisher(process.first, "there")

    def on_there(message):
        order.append(("there", message.data))
        back.publish(Int32(data=message.data + 1))
        order.append(("published", message.data))

    def on_back(message):
        order.append(("back", message.data))
        if message.data < 5:
            there.publish(Int32(data=message.data + 1))

    process.subscribe(process.second, "there", on_there)
    process.subscribe(process.first, "back", on_back)
    there.publish(Int32(data=0))
    process.until(lambda: ("published", 4) in order and ("back", 5) in order)
    assert order == [(name, k + (name == "back")) for k in (0, 2, 4) for name in ("there", "published", "back")]


def test_a_polled_subscription_keeps_the_newest(process):
    process.first.local = process.local
    polled = Polled(process.first, Int32, "numbers", QOS)
    process.local.add_subscription(process.first, polled._subscription, None)
    publisher = process.publisher(process.second, "numbers")
    for k in range(8):
        publisher.publish(Int32(data=k))
    assert [received.message.data for received in polled.take_all()] == [3, 4, 5, 6, 7]
    assert polled.take_all() == [] and polled.last.number == 8


@pytest.mark.parametrize(
    ("offered", "wanted"),
    [
        (QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT), QOS),
        (
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        ),
    ],
)
def test_what_only_the_middleware_can_do_is_left_to_it(process, offered, wanted):
    subscription = process.subscribe(process.second, "numbers", lambda _: None, wanted)
    process.publisher(process.first, "numbers", offered)
    assert not process.local.is_local(subscription)


def test_a_destroyed_subscription_receives_nothing(process):
    heard = []
    subscription = process.subscribe(process.second, "numbers", heard.append)
    publisher = process.publisher(process.first, "numbers")
    process.local.remove(subscription)
    process.second.destroy_subscription(subscription)
    publisher.publish(Int32())
    process.executor.spin_once(0.0)
    assert heard == []
