"""`./gravcomp demo`: processes, DDS and CAN frames, evaluated by the ground truth of the virtual robot."""

import os
import re
import signal
import time
from pathlib import Path

import pytest
from documents import documented

pytestmark = pytest.mark.graph

LOOP = ["can_bridge", "imu_estimator", "fem_simulator", "inverse_controller", "virtual_robot"]


PATIENCE = 120.0  # s


def processes(mark: str) -> dict[int, str]:
    """Return ids and command lines of the processes that have the mark in their environment."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if mark.encode() in (folder / "environ").read_bytes():
                found[int(folder.name)] = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:
            continue
    return {pid: line for pid, line in found.items() if line}


def marked(mark: str) -> list[str]:
    return list(processes(mark).values())


def pids(words: str, mark: str) -> list[int]:
    return [pid for pid, line in processes(mark).items() if words in line]


def until(condition, what: str):
    """Return the first true value of the condition."""
    end = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < end, what
        time.sleep(0.05)
    return found


def check_compensation(figures: dict) -> None:
    assert set(figures["nodes"]) == set(LOOP) and set(figures["nodes"].values()) == {"active"}
    assert figures["sag_mm"] > 20.0
    assert figures["residual_lateral_mm"] < figures["sag_mm"] / 5.0
    # One command a sample. A loop that leaves out every second sample has half the rate, one on a slow machine a little less than
    # all; `bench graph` measures the rate.
    assert 0.52 * figures["imu_rate_hz"] < figures["command_rate_hz"] < 1.02 * figures["imu_rate_hz"]
    # The virtual robot is a process as well: where it has not sent every sample in time, the demo says so.
    assert figures["overloaded"] or figures["imu_rate_hz"] == pytest.approx(100.0, rel=0.1)
    # A wrong axis or sign gives tens of degrees. An overloaded machine sends frames late: 0.1 s are 5 deg of this motion.
    assert figures["gravity_error_deg"] < (2.0 if figures["overloaded"] is None else 10.0)
    assert figures["delay_ms"]["median"] > 0.0
    assert figures["overloaded"] is None or "overloaded machine" in figures["overloaded"]
    assert figures["full_model_pct"] < 10.0  # the run of the tests has built the reduced model


@pytest.mark.rates
def test_the_robot_sags_and_is_compensated_while_it_is_tilted(measured):
    mark = f"GRAVCOMP_TEST={os.getpid()}-scenario"
    line = documented("./gravcomp demo --headless --duration 30 --json")[1:]
    answer = measured(*line, "--duration", "12", GRAVCOMP_TEST=mark.split("=")[1])
    assert answer.code == 0, answer.err
    check_compensation(answer.json)
    # The virtual robot and the model sag, straighten and turn alike.
    figures = answer.json
    assert figures["correlation"] > 0.9
    for name in ("held", "moving"):
        lateral, share = figures[f"{name}_lateral_mm"], figures[f"{name}_lateral_pct"]
        assert 0.0 < lateral < figures["sag_mm"] / 2.0
        assert share == pytest.approx(100.0 * lateral / figures["tip_error_without_mm"], rel=0.05, abs=0.1)
    assert figures["settle_s"] is None or figures["settle_s"] >= 0.0
    assert figures["unholdable"] is None, "the cables can hold the article's robot"
    assert marked(mark) == []


@pytest.mark.graph
def test_a_tracker_of_the_tip_corrects_the_model_where_the_firmware_is_the_board(measured):
    board = documented("./gravcomp demo --board emulated")[2:]
    answer = measured(*documented("./gravcomp demo --tracker 5")[1:], *board, "--headless", "--duration", "10", "--json")
    assert answer.code == 0, answer.err
    assert answer.json["residual_lateral_mm"] < answer.json["sag_mm"] / 5.0


@pytest.mark.rates
def test_a_recorded_imu_stream_drives_the_loop(measured, broad):
    trial = sorted(broad.glob("02_*.npz")) or sorted(broad.glob("*.npz"))
    line = documented("./gravcomp demo --imu FILE", FILE=trial[0])[1:]
    answer = measured(*line, "--headless", "--duration", "12", "--json")
    assert answer.code == 0, answer.err
    check_compensation(answer.json)
    assert answer.json["source"] == trial[0].name
    assert answer.json["tip_error_without_mm"] > 2.0 * answer.json["tip_error_with_mm"]


@pytest.mark.parametrize(
    "moment", ["", "gravcomp.launcher.node_host", "lib/gravcomp_fem/viewer", "lib/gravcomp_hw/virtual_robot"]
)
def test_ctrl_c_at_any_moment_leaves_no_process(gravcomp_process, moment, monkeypatch):
    """At once, while the nodes' host imports, while the nodes start, and in the run, which begins with the virtual robot."""
    mark = f"{os.getpid()}-ctrl-c-{moment}"
    monkeypatch.setenv("GRAVCOMP_TEST", mark)
    process = gravcomp_process(*documented("./gravcomp demo")[1:])
    until(lambda: any(moment in line for line in marked(f"GRAVCOMP_TEST={mark}")), moment)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    process.wait(timeout=PATIENCE)
    assert process.returncode == 130
    # The kernel ends a nodes' host whose creation was interrupted, a moment after the command.
    until(lambda: marked(f"GRAVCOMP_TEST={mark}") == [], "the end of all processes")


def test_the_nodes_of_a_killed_launcher_end(gravcomp_process, monkeypatch):
    mark = f"{os.getpid()}-kill"
    monkeypatch.setenv("GRAVCOMP_TEST", mark)
    process = gravcomp_process("demo", "--headless", "--duration", "120")
    until(lambda: len(marked(f"GRAVCOMP_TEST={mark}")) > 4, "the start of the nodes")
    process.kill()
    process.wait()
    until(lambda: marked(f"GRAVCOMP_TEST={mark}") == [], "the nodes' end")


def test_a_node_that_dies_ends_the_run_and_is_named(gravcomp_process, monkeypatch):
    mark = f"{os.getpid()}-node"
    monkeypatch.setenv("GRAVCOMP_TEST", mark)
    process = gravcomp_process("demo", "--headless", "--duration", "120")
    victims = until(lambda: pids("lib/gravcomp_fem/fem_simulator", f"GRAVCOMP_TEST={mark}"), "the start of the simulator")
    os.kill(victims[0], signal.SIGKILL)
    _, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    assert re.search(r"fem_simulator was ended by SIGKILL", error)
    assert marked(f"GRAVCOMP_TEST={mark}") == []
