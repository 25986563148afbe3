"""The loop on the board in a whole board: the same frames from the C code and the image, interrupts in the middle of a step."""

import pytest
from board_bench import Bench, blob_of

from gravcomp.firmware import requests
from gravcomp.firmware.emulator.image_board import ImageBoard
from gravcomp.firmware.host_board import HostBoard
from gravcomp.firmware.settings import STATES

pytestmark = pytest.mark.slow

MOTORS = range(1, 7)
SETTINGS = {"wiring": 1, "motors": 0b111111, "current_limit": 1000, "travel_per_count": 1e-6}


def running(kind, preempted_in="", **material) -> Bench:
    """A board whose loop has run for 0.2 s, from a host that drove."""
    bench = Bench(kind(SETTINGS, model=blob_of(**material)), MOTORS)
    bench.run(220, {1: 0.1})
    for motor in MOTORS:
        assert bench.ask(requests.request("zero", motor - 1)).done
    bench.run(8, {1: 0.1})
    if preempted_in:
        bench.board.machine.preempted_in = preempted_in
    assert bench.ask(requests.act("run")).done
    for k in range(20):
        bench.angles[1] += 3 * k
        bench.run(10, {1: 0.3} if k % 2 else None)  # the host's currents have no effect any more
    return bench


@pytest.mark.parametrize("material", [{}, {"law_points": 6, "branches": 2}], ids=["svk", "rubber that creeps"])
def test_host_and_image_send_the_same_frames_while_the_loop_runs(material):
    benches = [running(kind, **material) for kind in (HostBoard, ImageBoard)]
    for bench in benches:
        assert bench.last(0x315).data[1] == STATES.index("standalone") and any(current for _, current in bench.currents(2))
    for sent in (lambda b: b.host, lambda b: b.to_motors):
        first, second = ([(t, f.arbitration_id, bytes(f.data)) for t, f in sent(b) if t > 200] for b in benches)
        assert len(first) > 100 and first == second


def test_a_tick_in_the_middle_of_a_step_changes_nothing_of_the_step():
    undisturbed = running(ImageBoard)
    machine = undisturbed.board.machine
    at, size = machine.symbols["standalone"], 4096
    wanted = machine.read(at, size)
    assert any(wanted)
    for function in ("gc_factorise", "gc_programme_solve"):
        other = running(ImageBoard, function)
        other.run(1)  # the last step ends
        assert other.board.machine.read(at, size) == wanted, function
        assert other.board.machine.preemptions >= 15 and other.board.machine.resets == ["power"]
