"""The faults of the campaign."""

import signal
import time
from collections.abc import Callable
from dataclasses import dataclass

from gravcomp.bench.campaign import Campaign


@dataclass(frozen=True)
class Case:
    """A fault.

    inject: injects the fault; zero: the required response is zero current (True), holding (False) or none (None). The time to
    the response counts from the order, so it includes the delay of the order to the virtual robot. For a fault that stops the
    IMU's frames (`silent_imu`) it counts from the last valid frame on the bus.
    """

    name: str
    inject: Callable[[Campaign], None]
    zero: bool | None
    silent_imu: bool = False

    def time_to_safe(self, campaign: Campaign) -> float | None:
        """Inject the fault; return ms until the response, or None when there is none."""
        return campaign.time_to_safe(self.inject, zero=bool(self.zero), silent_imu=self.silent_imu)


def _virtual(**fault: object) -> Callable[[Campaign], None]:
    return lambda campaign: campaign.probe.fault(**fault)


def send_signal(executable: str, number: int) -> Callable[[Campaign], None]:
    """Return a function that sends a signal to a node's process."""
    return lambda campaign: campaign.graph.process(executable).send_signal(number)


def _command(displacement: list[float]) -> Callable[[Campaign], None]:
    # Several times, because a single one may arrive after a command of the controller.
    return lambda campaign: campaign.probe.command(displacement, count=5)


def _stall(campaign: Campaign) -> None:
    """Block a motor and command 4 mm, because a stall is detected only when the motor must move."""
    campaign.probe.enable(False)
    campaign.probe.fault(kind="stall", cable="s1c1")
    time.sleep(0.1)
    campaign.begin = time.time()
    campaign.probe.command([0.004, 0.0, 0.0, 0.0, 0.0, 0.0], count=60)


CASES = (
    Case("imu frames lost", _virtual(kind="drop", frames="imu"), zero=False, silent_imu=True),
    Case("imu frames corrupt", _virtual(kind="corrupt", frames="imu"), zero=False, silent_imu=True),
    Case("imu silent", _virtual(kind="imu_silent"), zero=False, silent_imu=True),
    Case("imu stuck", _virtual(kind="imu_stuck"), zero=False),
    Case("imu saturated", _virtual(kind="imu_saturated"), zero=False),
    Case("imu invalid", _virtual(kind="imu_invalid"), zero=False),
    Case("feedback of a motor lost", _virtual(kind="drop", frames="feedback", cable="s2c1"), zero=True),
    Case("feedback late", _virtual(kind="delay", frames="feedback", delay_ms=400), zero=True),
    Case("bus-off", _virtual(kind="bus_off"), zero=True),
    Case("motor with a wrong id", _virtual(kind="wrong_id", frames="feedback", cable="s1c2"), zero=True),
    Case("encoder jump", _virtual(kind="encoder_jump", cable="s1c3"), zero=True),
    Case("stall", _stall, zero=True),
    Case("command nan", _command([float("nan")] * 6), zero=False),
    Case("command outside", _command([0.5] * 6), zero=False),
    Case("command jumps", _command([0.025] * 6), zero=False),
    Case("estimator hangs", send_signal("imu_estimator", signal.SIGSTOP), zero=False),
    Case("simulator hangs", send_signal("fem_simulator", signal.SIGSTOP), zero=False),
    Case("controller hangs", send_signal("inverse_controller", signal.SIGSTOP), zero=False),
    Case("bridge hangs", send_signal("can_bridge", signal.SIGSTOP), zero=True),
    Case("some frames lost", _virtual(kind="drop", probability=0.05), zero=None),
    Case("frames repeated", _virtual(kind="duplicate", probability=0.3), zero=None),
    Case("frames reordered", _virtual(kind="reorder", probability=0.1), zero=None),
    Case("cable breaks", _virtual(kind="cable_break", cable="s2c2"), zero=None),
    Case("heater stuck on", _virtual(kind="heater_stuck_on"), zero=None),
)
