"""Motors that move several cables: descriptions, what their cables can do, the bridge, and the loop on antagonistic pairs."""

import dataclasses
import math

import numpy as np
import pytest
from motor_bench import Bench

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.config import ConfigError
from gravcomp.description import Cable, Elements, Limits, Robot, Segment, load_robot_file
from gravcomp.description.hardware import Hardware, Motor, parse_hardware
from gravcomp.description.pairs import check_pairs
from gravcomp.description.transmission import Transmission
from gravcomp.inverse import straight_target
from gravcomp.motors.state import State
from gravcomp.simulation import Simulator
from gravcomp.virtual.motion import StaticMotion, base_orientation

CABLES = ("a", "b", "c", "d")
PAIRS = Hardware(motors=(Motor("a", 1, pair="c", preload=1e-3), Motor("b", 2, pair="d")), order=CABLES)


def robot(**limits) -> Robot:
    """A small robot with four cables, 90 deg apart."""
    segment = Segment("s", 0.06, 9e-3, 3e-3)
    cables = tuple(Cable(name, math.radians(90 * i), 3e-3, segment="s") for i, name in enumerate(CABLES))
    return Robot("small", segments=(segment,), cables=cables, elements=Elements(along=4), limits=Limits(**limits))


def motor(**changes):
    return {"cable": "a", "can_id": 1} | changes


@pytest.mark.parametrize(
    ("motors", "complaint"),
    [
        ([motor(pair="b", also={"c": 1.0})], "has pair and also"),
        ([motor(pair="a")], "names its cable 'a' twice"),
        ([motor(preload_mm=1.0)], "preload_mm without pair"),
        ([motor(also={"b": 0.0})], "the ratio of 'b' is 0"),
        ([motor(also={"b": "half"})], r"motors\[0\].also.b is 'half'; a number is needed"),
        ([motor(ratio=0.0)], r"motors\[0\].ratio is 0.0; allowed: 0.01 to 100"),
        ([motor(pair="b"), {"cable": "b", "can_id": 2}], "cable b is given to more than one motor.*`differential: true`"),
        ([motor(), {"cable": "b", "can_id": 1}], "can_id 1 is given to more than one motor; several cables of one motor are one"),
        (
            [motor(also={"b": 1.0}, differential=True), {"cable": "a", "can_id": 2, "also": {"b": 1.0}, "differential": True}],
            "two motors move the same cables with the same ratios",
        ),
        ([motor(pair="x")], "hardware.motors are for the cables a, x; needed: a, b"),
    ],
)
def test_motors_that_cannot_be_are_refused(motors, complaint):
    with pytest.raises(ConfigError, match=f"robot.yaml.*{complaint}"):
        parse_hardware({"motors": motors}, source="robot.yaml", cables=("a", "b"))


def test_a_pair_on_the_same_side_is_refused():
    hardware = Hardware(motors=(Motor("a", 1, pair="c"), Motor("b", 2), Motor("d", 3)), order=CABLES)
    check_pairs(hardware, robot(), "robot.yaml")
    near = dataclasses.replace(robot().cables[2], angle=math.radians(40))
    same_side = dataclasses.replace(robot(), cables=(*robot().cables[:2], near, robot().cables[3]))
    with pytest.raises(ConfigError, match=r"robot.yaml: hardware.motors\[0\].pair is 'c', on the same side of the robot as 'a'"):
        check_pairs(hardware, same_side, "robot.yaml")


def test_the_cables_of_a_pair_move_against_each_other():
    hardware = parse_hardware(
        {"motors": [motor(pair="c", preload_mm=1.0), {"cable": "b", "pair": "d", "can_id": 2}]}, source="", cables=CABLES
    )
    assert hardware.cables == CABLES and not hardware.transmission.direct
    assert hardware.transmission.cables([0.003, 0.002]) == pytest.approx([0.004, 0.002, -0.002, -0.002])
    assert hardware.transmission.motors([0.004, 0.002, -0.002, -0.002]) == pytest.approx([0.003, 0.002])


def test_forces_and_displacements_do_the_same_work():
    rng = np.random.default_rng(1)
    motors = (Motor("a", 1, also={"b": 0.5}), Motor("c", 2, differential=True, also={"d": 1.0}))
    motors += (Motor("c", 3, differential=True, also={"d": -1.0}),)
    transmission = Transmission(motors, CABLES)
    for _ in range(20):
        move, tension = rng.normal(size=3), rng.uniform(size=4)
        work = tension @ (np.array(transmission.cables(move)) - transmission.preload)
        assert np.dot(transmission.forces(tension), move) == pytest.approx(work)
    rows, antagonists = transmission.couplings()
    assert (rows @ transmission.matrix == pytest.approx(np.zeros((1, 3)))) and not antagonists.any()


def test_a_loaded_antagonist_gets_its_path_and_the_other_follows():
    wanted = np.array([0.004, 0.0, -0.001, 0.0])
    possible = PAIRS.transmission.possible(wanted, np.array([2.0, 0.0, 0.0, 0.0]))
    assert possible[0] == pytest.approx(0.004, abs=1e-6) and possible[2] == pytest.approx(-0.002, abs=1e-6)


def test_the_bridge_drives_pairs_and_refuses_what_they_cannot_do():
    bench = Bench(PAIRS).start()
    goal = PAIRS.transmission.cables([0.002, -0.001])
    bench.run(1.2, lambda t: goal)
    assert bench.bridge.state is State.ACTIVE
    assert [m.displacement for m in bench.motors] == pytest.approx([0.002, -0.001], abs=3e-5)
    assert bench.bridge.snapshot().displacement == pytest.approx(goal, abs=3e-5)
    assert len(bench.bridge.snapshot().tension) == len(bench.bridge.snapshot().current) == 4
    bench.run(0.1, lambda t: [0.002, 0.0, 0.002, 0.0])
    assert bench.bridge.state is State.HOLDING and "with the cables that its motor moves as well" in bench.bridge.message


def test_pairs_are_released_to_their_zero_positions_and_not_homed():
    bench = Bench(PAIRS).start()
    bench.run(1.0, lambda t: PAIRS.transmission.cables([0.002, -0.001]))
    done, why = bench.bridge.home(bench.now)
    assert not done and "motors that move several cables" in why and bench.bridge.state is State.ACTIVE
    bench.bridge.release(bench.now)
    bench.run(2.0)
    assert bench.bridge.state is State.STOPPED
    assert [m.displacement for m in bench.motors] == pytest.approx([0.0, 0.0], abs=1e-4)
    waiting = Bench(PAIRS, zero="home_at_start").start()
    assert waiting.bridge.state is State.STOPPED and "zero: start" in waiting.bridge.message


@pytest.mark.slow
@pytest.mark.parametrize("preload", [0.0, 0.3e-3])
def test_the_loop_holds_a_robot_with_one_motor_for_two_antagonists(preload):
    """The sag lies between the planes of the two pairs, so that both motors are needed."""
    file = load_robot_file("article")
    hardware = dataclasses.replace(PAIRS, motors=tuple(dataclasses.replace(m, preload=preload) for m in PAIRS.motors))
    setup = dataclasses.replace(Setup.of(file), robot=robot(), nominal=robot(), hardware=hardware)
    loop = ClosedLoop(setup, StaticMotion(base_orientation(0.0, math.radians(30.0))), heating=False)
    loop.release()
    loop.run(1.5)
    # Its own pairs hold the robot up in part; this is how far it sags without cables.
    sag = np.linalg.norm(Simulator(robot(), reduced=False).solve(loop.trace.gravity[-1]).tip_position[:2])
    loop.hold(straight_target(0.06))
    loop.run(3.0)
    end = loop.trace.between(loop.time - 0.3)
    assert np.linalg.norm(end.tip_position[:, :2], axis=1).mean() < 0.15 * sag  # the model's modulus is 7 % too high
    assert end.command[:, 0] + end.command[:, 2] == pytest.approx(2 * preload, abs=1e-6), "no antagonist on its own"
