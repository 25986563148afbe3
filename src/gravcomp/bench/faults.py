"""The fault campaign on the running graph: every fault, hostile frames and messages, and every process killed and restarted.

The judge is the bus: no motor current beyond the limit, ever (`limit_violations`); after a fault either zero current or, where
the bridge's table says so, its state HOLDING as others hear of it (`safe_ms`); commands followed again by themselves after a kill (`recovered`).
"""

import os
import random
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass

import can

from gravcomp.bench.probe import CurrentMonitor, Probe
from gravcomp.canbus import codec
from gravcomp.canbus.imu_stream import IMU_FRAMES
from gravcomp.description import load_robot_file
from gravcomp.description.hardware import parse_hardware
from gravcomp.launcher.virtual_graph import NODES, RunningGraph
from gravcomp.motors.driver import RECEIVED_FRAMES
from gravcomp.motors.state import State

_SAFE_TIMEOUT = 2.0  # s to wait for a safe state
_RECOVERY = 5.0  # s, from the restart of a process to the first command that is followed
_SETTLED = 0.3  # s in the state ACTIVE before a fault is injected
_STOPS = 10
_BURST, _BURST_PAUSE = 40, 0.005  # hostile frames: about 8,000/s, three times the honest traffic
_OTHER_IDS = tuple(i for i in range(0x7FF) if i not in (0x200, 0x1FF))
_MESSAGE_SHARE = 0.05  # of the hostile frames and messages


@dataclass(frozen=True)
class Case:
    """A fault: what is injected, and whether the answer is zero current (True), holding (False), or nothing (None).

    The time to the answer counts from the order, so it holds the way of the order to the virtual robot; where the fault is that
    the IMU's frames end (`silent_imu`), from the last good one on the bus.
    """

    name: str
    inject: Callable[["Campaign"], None]
    zero: bool | None
    silent_imu: bool = False


def _virtual(**fault: object) -> Callable[["Campaign"], None]:
    return lambda campaign: campaign.probe.fault(**fault)


def _signal(executable: str, number: int) -> Callable[["Campaign"], None]:
    return lambda campaign: campaign.graph.process(executable).send_signal(number)


def _command(displacement: list[float]) -> Callable[["Campaign"], None]:
    return lambda campaign: campaign.probe.command(displacement, count=5)  # one may be overtaken by the controller's


def _stall(campaign: "Campaign") -> None:
    """A blocked motor is noticed when it shall move: it is asked for 4 mm."""
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
    Case("estimator hangs", _signal("imu_estimator", signal.SIGSTOP), zero=False),
    Case("simulator hangs", _signal("fem_simulator", signal.SIGSTOP), zero=False),
    Case("controller hangs", _signal("inverse_controller", signal.SIGSTOP), zero=False),
    Case("bridge hangs", _signal("can_bridge", signal.SIGSTOP), zero=True),
    Case("some frames lost", _virtual(kind="drop", probability=0.05), zero=None),
    Case("frames repeated", _virtual(kind="duplicate", probability=0.3), zero=None),
    Case("frames reordered", _virtual(kind="reorder", probability=0.1), zero=None),
    Case("cable breaks", _virtual(kind="cable_break", cable="s2c2"), zero=None),
    Case("heater stuck on", _virtual(kind="heater_stuck_on"), zero=None),
)


class Campaign:
    """One running graph with its probe and monitor."""

    def __init__(self, graph: RunningGraph, seed: int):
        file = load_robot_file("article")
        self.limit = parse_hardware(file.section("hardware"), source=file.source).drive.current_limit
        self.graph, self.probe, self.monitor = graph, Probe(graph), CurrentMonitor(graph, self.limit)
        self.random = random.Random(seed)
        self.crashes: list[str] = []
        self.begin = 0.0

    def close(self) -> None:
        self.probe.close()
        self.monitor.close()

    def make_active(self, timeout: float = 60.0) -> bool:
        """Commands are followed; after what latches, `~/resume` is called, as the table of states says."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            followed = self.monitor.trace_after(time.time(), 1.5)
            last = self.probe.states[-1] if self.probe.states else None
            if followed and last and last.state is State.ACTIVE and time.time() - last.time > _SETTLED and self.probe.match():
                return True
            if last and (last.state is State.STOPPED or (last.state is State.FAULT and "resume" in last.message)):
                self.probe.call("can_bridge/resume")
        return False

    def time_to_safe(self, case: Case) -> float | None:
        """ms from the injection; None when it never got safe."""
        self.begin = time.time()
        case.inject(self)
        if not case.zero and self.probe.state_at(self.begin) is not State.ACTIVE:
            return 0.0  # it was holding, or without current, already
        if case.zero:
            safe = self.monitor.zero_since(self.begin, _SAFE_TIMEOUT)
        else:
            seen = self.probe.wait_for(set(State) - {State.ACTIVE}, self.begin, _SAFE_TIMEOUT)
            safe = seen.time if seen else None
        if safe is None:
            return None
        return 1e3 * (safe - (max(self.begin, self.monitor.last_sample) if case.silent_imu else self.begin))

    def mend(self) -> None:
        """End every fault, let every process go on."""
        for executable in NODES:
            self.graph.process(executable).send_signal(signal.SIGCONT)
        self.probe.fault()
        self.probe.enable(True)

    def note_dead(self) -> None:
        """Processes that ended by themselves are crashes; they are started again, so that the campaign goes on."""
        for name, why in self.graph.dead().items():
            self.crashes.append(f"{name} {why}")
            self.graph.restart(name.rpartition("/")[2])

    def hostile_frames(self, count: int) -> None:
        """Random and malformed frames; those of motor commands left out, for they would be the attacker's own currents."""
        for done in range(0, count, _BURST):
            self.monitor.link.send(self._hostile_frame() for _ in range(min(_BURST, count - done)))
            time.sleep(_BURST_PAUSE)

    def _hostile_frame(self) -> can.Message:
        chance = self.random
        frame_id = chance.choice(RECEIVED_FRAMES if chance.random() < 0.7 else _OTHER_IDS)
        data = bytearray(os.urandom(chance.choice((8, 8, 8, 8, 0, 3, 7))))
        if frame_id in IMU_FRAMES and len(data) == 8 and chance.random() < 0.5:
            data[7] = codec.check_byte(frame_id, bytes(data[:7]))
        kind = chance.random()
        return can.Message(
            arbitration_id=frame_id,
            is_extended_id=kind < 0.02,
            is_remote_frame=0.02 <= kind < 0.04,
            is_error_frame=0.04 <= kind < 0.05 and not frame_id & 0x40,
            data=b"" if 0.02 <= kind < 0.04 else data,
            dlc=8 if 0.02 <= kind < 0.04 else len(data),
        )


def run(progress: Callable[[str], None], *, kills: int = 20, frames: int = 1_000_000, seed: int = 1, every: int = 1) -> dict:
    """Every `every`-th of the faults, `kills` of each process, `frames` hostile frames and messages. Keys as in the figures' table."""
    with RunningGraph({"virtual_robot": {"motion": "tremor"}}) as graph:  # so that the motors always work
        progress("starting the graph")
        graph.wait_for_commands()
        campaign = Campaign(graph, seed)
        try:
            safe, unanswered, stuck = _faults(campaign, CASES[::every], progress)
            recovery, kill_safe, late = _kills(campaign, kills, progress)
            hostile = _hostile(campaign, frames, progress)
            if not campaign.make_active():
                stuck.append("hostile frames and messages")
            campaign.note_dead()
        finally:
            campaign.close()
    times = [t for _, t in recovery if t is not None]
    return {
        "robot": "virtual robot",
        "frames": hostile["sent"],
        "frames_taken_by_bridge": hostile["taken"],
        "crashes": len(campaign.crashes),
        "crash_list": campaign.crashes,
        "limit_violations": campaign.monitor.violations,
        "largest_current_a": campaign.monitor.largest,
        "current_frames_watched": campaign.monitor.frames,
        "kills": len(recovery),
        "recovered": sum(t <= _RECOVERY for t in times),
        "not_recovered": len(recovery) - sum(t <= _RECOVERY for t in times),
        "recovery_s": {
            "median": sorted(times)[len(times) // 2] if times else None,
            "worst": {name: max((t for n, t in recovery if n == name and t is not None), default=None) for name in NODES},
        },
        "late_recoveries": late,
        "safe_ms": {**safe, **kill_safe},
        "worst_safe_ms": max([*safe.values(), *kill_safe.values()], default=None),
        "not_safe": unanswered,
        "not_back": stuck,
    }


def _faults(campaign: Campaign, cases: tuple[Case, ...], progress: Callable[[str], None]) -> tuple[dict, list, list]:
    """Time to safe by fault (ms), faults without an answer, faults after which commands were not followed again."""
    safe, unanswered, stuck = {}, [], []
    for case in cases:
        if not campaign.make_active():
            stuck.append(f"before {case.name}")
        progress(f"fault: {case.name}")
        time.sleep(campaign.random.uniform(0.0, 0.5))
        if case.zero is None:
            case.inject(campaign)
            time.sleep(2.0)
        else:
            elapsed = campaign.time_to_safe(case)
            if elapsed is None:
                unanswered.append(case.name)
            else:
                safe[case.name] = round(elapsed, 1)
        campaign.mend()
        campaign.note_dead()
        if not campaign.make_active():
            stuck.append(case.name)
    progress("stop")
    stops = [_stop(campaign) for _ in range(_STOPS)]
    if None in stops:
        unanswered.append("stop")
    safe["stop"] = max((round(t, 1) for t in stops if t is not None), default=None)
    campaign.make_active()
    return safe, unanswered, stuck


def _stop(campaign: Campaign) -> float | None:
    """ms from calling ~/stop to zero current on the bus."""
    campaign.make_active()
    answer = campaign.probe.call("can_bridge/stop")
    zero = campaign.monitor.zero_since(answer["sent"], _SAFE_TIMEOUT)
    return None if zero is None else 1e3 * (zero - answer["sent"])


def _kills(
    campaign: Campaign, kills: int, progress: Callable[[str], None]
) -> tuple[list[tuple[str, float | None]], dict, list[str]]:
    """Process and recovery time (s) of each kill, None for none; the worst time to safe (ms) by process; what the bridge said
    when a recovery took too long.
    """
    order = [name for name in NODES for _ in range(kills)]
    campaign.random.shuffle(order)
    recovery, worst, late = [], {}, []
    for number, executable in enumerate(order, 1):
        progress(f"kill {number} of {len(order)}: {executable}")
        campaign.probe.match()  # else the answer to this kill would be heard as late as the bridge is found after the last
        case = Case(executable, _signal(executable, signal.SIGKILL), zero=executable in ("can_bridge", "virtual_robot"))
        elapsed = campaign.time_to_safe(case)
        if elapsed is not None:
            key = f"{executable} killed"
            worst[key] = max(worst.get(key, 0.0), round(elapsed, 1))
        time.sleep(campaign.random.uniform(0.0, 1.0))
        campaign.graph.restart(executable)
        begin = time.time()
        followed = campaign.monitor.trace_after(begin, _RECOVERY)
        if followed is None:
            late.append(f"{executable}: {campaign.probe.states[-1].message if campaign.probe.states else 'no state'}")
            campaign.make_active()
            followed = campaign.monitor.trace_after(begin, 1.0) and time.time()
        recovery.append((executable, None if followed is None else round(followed - begin, 2)))
        campaign.note_dead()
        time.sleep(campaign.random.uniform(0.2, 1.0))
    return recovery, worst, late


def _hostile(campaign: Campaign, total: int, progress: Callable[[str], None]) -> dict:
    """Hostile frames and messages, in rounds between which the bridge is made to drive again."""
    messages = int(total * _MESSAGE_SHARE)
    rounds = max(1, total // 50_000)
    time.sleep(2.5)  # until the next diagnostics
    before = int(campaign.probe.count()["bridge"].get("frames_received", 0))
    for number in range(rounds):
        progress(f"hostile frames and messages: round {number + 1} of {rounds}")
        campaign.make_active(5.0)
        campaign.hostile_frames((total - messages) // rounds)
        campaign.probe.flood(messages // rounds)
        campaign.probe.fault()
        campaign.note_dead()
    time.sleep(2.5)
    taken = int(campaign.probe.count()["bridge"].get("frames_received", 0)) - before  # means nothing after a crash
    return {"sent": rounds * ((total - messages) // rounds + messages // rounds), "taken": taken}
