"""Several CAN buses: descriptions that cannot be, a bus that is missing or lost, and buses that are swapped."""

import dataclasses
import time

import can
import pytest
from motor_bench import Bench, bench_that_follows

from gravcomp.canbus import codec
from gravcomp.canbus.bus import BusError
from gravcomp.canbus.buses import CanBuses
from gravcomp.canbus.link import CanLink
from gravcomp.canbus.multicast import private_channel
from gravcomp.config import ConfigError
from gravcomp.description.hardware import CanBus, Hardware, Motor, parse_hardware
from gravcomp.motors.guard_protocol import GuardSettings
from gravcomp.motors.state import State

BUSES = (CanBus(name="near", channel="239.74.1.1:43001"), CanBus(name="far", channel="239.74.1.1:43002"))
HARDWARE = Hardware(
    motors=(*(Motor(f"c{i}", i, bus="near") for i in range(1, 7)), *(Motor(f"d{i}", i, bus="far") for i in range(1, 4))),
    buses=BUSES,
    imu_bus="near",
)
GOAL = [1e-3 * (-1) ** i for i in range(9)]


def following() -> Bench:
    return bench_that_follows(GOAL, HARDWARE)


def section(**changes):
    motors = [{"cable": "a", "can_id": 1, "bus": "near"}, {"cable": "b", "can_id": 1, "bus": "far"}]
    buses = [{"name": "near", "channel": "can0"}, {"name": "far", "channel": "can1"}]
    return {"motors": motors, "buses": buses} | changes


NINE = [{"cable": f"c{i}", "can_id": i % 8 + 1} for i in range(9)]


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"motors": NINE, "buses": []}, "9 motors; allowed: 1 to 8 on a bus; more motors need more buses"),
        ({"motors": [{**motor, "bus": "far"} for motor in NINE]}, "9 motors on bus 'far'; allowed: 1 to 8 on a bus"),
        ({"motors": [{"cable": "a", "can_id": 1}]}, r"motors\[0\].bus is missing; allowed: near, far"),
        ({"motors": [{"cable": "a", "can_id": 1, "bus": "fra"}]}, r"motors\[0\].bus is 'fra'; allowed: near, far"),
        ({"buses": []}, r"motors\[0\].bus is 'near'; allowed: none"),
        ({"buses": [{"channel": "can0"}, {"name": "far"}]}, r"key 'hardware.buses\[0\].name' is missing"),
        ({"buses": [{"name": " "}, {"name": "far"}]}, r"buses\[0\].name is empty"),
        ({"buses": [{"name": "near"}, {"name": "far"}]}, "interface and channel .* is given to more than one bus"),
        ({"buses": [{"name": "near", "channel": "can0"}] * 2}, "name 'near' is given to more than one bus"),
        ({"can": {"channel": "can2"}}, "hardware.can and hardware.buses are both given; allowed: one of them"),
        ({"imu_bus": "middle"}, "imu_bus is 'middle'; allowed: near, far"),
        (
            {"motors": [{"cable": "a", "can_id": 2, "bus": "near"}, {"cable": "b", "can_id": 2, "bus": "near"}]},
            "can_id 2 is given to more than one motor on bus 'near'; several cables of one motor are one entry",
        ),
    ],
)
def test_buses_that_cannot_be_are_refused(changes, complaint):
    with pytest.raises(ConfigError, match=f"robot.yaml.*{complaint}"):
        parse_hardware(section(**changes), source="robot.yaml")


def test_a_channel_for_each_bus_replaces_those_of_the_file():
    hardware = parse_hardware(section(), source="robot.yaml")
    assert [bus.channel for bus in hardware.on("socketcan", "can4, can5").buses] == ["can4", "can5"]
    assert hardware.on("socketcan", "").board_bus.interface == "socketcan"
    with pytest.raises(ConfigError, match="channel is 'can4', 1 channels; needed: one each for the buses near, far"):
        hardware.on("", "can4")


def test_motors_with_the_same_id_on_two_buses_follow_their_own_commands():
    bench = following()
    bench.run(0.5, lambda t: GOAL)
    assert [motor.displacement for motor in bench.motors] == pytest.approx(GOAL, abs=2e-5)


@pytest.mark.parametrize("closed", [True, False])
def test_without_one_bus_the_cables_on_the_others_hold_and_its_return_is_noticed(closed):
    bench = following()
    begin = bench.now
    # Either its adapter is gone, or the bus is open and nobody on it answers.
    if closed:
        bench.down = {"far": "no such device"}
    else:
        for motor in bench.motors[6:]:
            motor.silent = True
    bench.run(0.3, lambda t: GOAL)
    assert bench.bridge.state is State.HOLDING and "CAN bus 'far' lost" in bench.bridge.message
    assert bench.since(begin, State.HOLDING) < 0.12
    loaded = [motor for motor in bench.motors[:6] if motor.displacement > 0.0]
    bench.run(0.2, lambda t: [0.0] * 9)  # no command is followed
    assert [motor.displacement for motor in loaded] == pytest.approx([1e-3] * len(loaded), abs=5e-5)
    assert bench.bridge.resume(bench.now)[0] and "nothing to resume" in bench.bridge.resume(bench.now)[1]
    bench.down = {}
    for motor in bench.motors:
        motor.silent = False
    bench.run(0.6, lambda t: GOAL)
    assert bench.bridge.state is State.ACTIVE


def test_a_motor_that_fails_on_the_bus_that_is_left_is_a_fault():
    bench = following()
    bench.down = {"far": "no such device"}
    bench.run(0.3)
    bench.motors[0].silent = True
    bench.run(0.3)
    assert bench.bridge.state is State.FAULT
    assert all(motor.current == 0.0 for motor in bench.motors[:6])


def test_without_any_bus_there_is_a_fault():
    bench = following()
    bench.down = {"near": "no such device", "far": "no such device"}
    bench.run(0.05)
    assert bench.bridge.state is State.FAULT


def test_swapped_buses_are_found_by_the_ids_before_anything_moves():
    bench = Bench(HARDWARE)
    for motor in bench.motors:
        motor.bus = {"near": "far", "far": "near"}[motor.bus]
    bench.start()
    bench.run(0.5, lambda t: GOAL)
    assert bench.bridge.state is State.FAULT and bench.largest_current == 0.0
    assert "motor id 4, 5, 6 answers on bus 'far'" in bench.bridge.message and "are the buses swapped?" in bench.bridge.message


def test_swapped_buses_with_the_same_ids_are_found_by_the_board():
    hardware = dataclasses.replace(
        HARDWARE, motors=tuple(Motor(f"{bus}{i}", i, bus=bus) for bus in ("near", "far") for i in range(1, 4))
    )
    bench = Bench(hardware)
    bench.board_bus = "far"
    bench.start()
    bench.run(0.5, lambda t: [1e-3] * 6)
    assert bench.bridge.state is State.FAULT and bench.largest_current == 0.0
    assert "the IMU board answers on bus 'far', but is described on bus 'near'" in bench.bridge.message


def test_every_bus_has_a_guard_of_its_own():
    near, far = (GuardSettings.of(HARDWARE, bus) for bus in range(2))
    assert near.can_ids == [1, 2, 3, 4, 5, 6] and far.can_ids == [1, 2, 3]
    assert near.address != far.address


def test_turns_are_kept_by_bus():
    bench = following()
    record = bench.bridge.zero_record()
    assert len(record) == 9
    later = Bench(HARDWARE)
    later.bridge.restore(record)
    later.motors = bench.motors
    later.now = bench.now
    later.start()
    assert later.bridge.snapshot().displacement == pytest.approx([m.displacement for m in bench.motors], abs=2e-5)


def frame(channel, angle=0):
    message = codec.encode("MotorFeedback1", angle=angle, speed=0, current=0)
    message.channel = channel
    return message


@pytest.fixture
def wires():
    """Two links of several buses on the same wires."""
    settings = [CanBus(name=name, channel=private_channel()) for name in ("near", "far")]
    links = [CanBuses(settings, "near") for _ in range(2)]
    for link in links:
        link.open()
    yield links
    for link in links:
        link.close()


def test_frames_arrive_from_and_at_the_bus_in_their_channel(wires):
    one, other = wires
    one.send([frame("far", 1), frame("near", 2), frame(None, 3)])
    received = other.receive(0.5) + other.receive(0.05)
    assert sorted((f.channel, f.data[1]) for f in received) == [("far", 1), ("near", 2), ("near", 3)]


def test_receiving_waits_for_the_first_frame_of_any_bus(wires):
    one, other = wires
    one.send([frame("far")])
    begin = time.monotonic()
    assert [f.channel for f in other.receive(5.0)] == ["far"]
    assert other.receive(0.02) == [] and time.monotonic() - begin < 2.0


def test_a_bus_that_is_missing_at_the_start_is_named():
    settings = [CanBus(name="near", channel=private_channel()), CanBus(name="far", channel="10.0.0.1:80")]
    with pytest.raises(BusError, match=r"bus 'far': .*not a multicast group"):
        CanBuses(settings, "near").open()


class Unplugged:
    """A bus whose adapter is pulled out and put in again."""

    def __init__(self):
        self.gone, self.frames = False, []

    def open(self, settings, frame_ids):
        if self.gone:
            raise BusError("no such device")
        return self

    def recv(self, timeout):
        if self.gone:
            raise can.CanOperationError("no such device")
        return self.frames.pop(0) if self.frames else None

    def fileno(self):
        raise NotImplementedError

    def send(self, message):
        self.recv(0.0)

    def shutdown(self):
        pass


def test_a_lost_bus_is_reopened_while_the_other_goes_on():
    adapters = {"near": Unplugged(), "far": Unplugged()}
    buses = CanBuses(BUSES, "near", None, lambda bus, ids: CanLink(bus, ids, opener=adapters[bus.name].open))
    buses.open()
    adapters["far"].gone = True
    adapters["near"].frames = [frame("near")]
    assert len(buses.receive(0.0)) == 1
    assert list(buses.lost) == ["far"] and buses.is_open
    assert not buses.send([frame("far")]) and buses.send([frame("near")])
    adapters["far"].gone = False
    end = time.monotonic() + 10.0
    while buses.lost and time.monotonic() < end:
        buses.receive(0.01)
    assert not buses.lost
    buses.close()
