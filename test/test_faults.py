"""The running graph under faults, observed on the bus. The whole campaign is `./gravcomp bench faults`."""

import signal
import time

import numpy as np
import pytest

from gravcomp.bench.campaign import Campaign
from gravcomp.bench.fault_cases import CASES, send_signal
from gravcomp.bench.hostile_frames import send_hostile_frames
from gravcomp.launcher.virtual_graph import START_TIMEOUT, RunningGraph
from gravcomp.motors.state import State

pytestmark = pytest.mark.rates


@pytest.fixture(scope="module")
def campaign():
    with RunningGraph({"virtual_robot": {"motion": "tremor", "feedback_rate": 125}}) as graph:
        campaign = Campaign(graph, seed=7)
        # It resumes a bridge that a busy machine has stopped at the start.
        assert campaign.make_active(START_TIMEOUT)
        yield campaign
        campaign.close()


@pytest.fixture(autouse=True)
def driving(campaign):
    """Start every test with a bridge that follows commands; at its end the bridge must follow commands again."""
    assert campaign.make_active()
    yield
    campaign.clear_faults()
    campaign.note_dead()
    assert campaign.make_active()
    assert campaign.crashes == [] and campaign.monitor.violations == 0


@pytest.mark.parametrize(
    "name", ["imu silent", "feedback of a motor lost", "bus-off", "command nan", "controller hangs", "bridge hangs"]
)
def test_a_fault_leads_to_zero_current_or_holding(campaign, name):
    case = next(case for case in CASES if case.name == name)
    assert case.time_to_safe(campaign) is not None


@pytest.mark.parametrize("executable", ["can_bridge", "virtual_robot", "inverse_controller"])
def test_a_killed_process_can_be_started_again(campaign, executable):
    kill = send_signal(executable, signal.SIGKILL)
    assert campaign.time_to_safe(kill, zero=executable != "inverse_controller") is not None
    campaign.graph.restart(executable)
    assert campaign.make_active()


def test_a_killed_bridge_starts_again_with_its_zero_positions(campaign):
    """Without current the robot sags and pulls its cables out; a bridge without zero positions would take that place as zero."""
    for _ in range(2):
        # Without commands the bridge continues to hold, so the probe finds that state even if it discovers the new node late.
        asked = time.time()  # the bridge can hold before the service has answered
        campaign.probe.enable(False)
        assert campaign.probe.wait_for({State.HOLDING}, asked, 10.0)
        killed = time.time()
        campaign.graph.process("can_bridge").send_signal(signal.SIGKILL)
        campaign.graph.restart("can_bridge")
        seen = campaign.probe.wait_for({State.HOLDING}, killed, 30.0)
        if seen:
            break
        # A guard that a busy machine has stopped while the cables ran out has lost count, and says so; a defect does it twice.
        assert "could not be counted" in campaign.probe.states[-1].message
        campaign.clear_faults()
        assert campaign.make_active()
    assert seen, [state for state in campaign.probe.states if state.time >= killed]
    time.sleep(0.05)
    assert np.abs(campaign.probe.displacement()).max() > 0.3e-3


def test_hostile_frames_and_messages_end_no_process(campaign):
    send_hostile_frames(campaign.monitor.link, campaign.random, 5000)
    campaign.probe.flood(500)
    assert campaign.graph.dead() == {}
