"""The fault campaign on the running graph: every fault, hostile frames and messages, and every process killed and restarted.

The results are read from the bus. No motor current may exceed the limit (`limit_violations`). After a fault the currents are
zero or, where the bridge's table of states says so, the bridge reports HOLDING (`safe_ms`). After a kill, commands are followed
again without intervention (`recovered`).
"""

import signal
import time
from collections.abc import Callable

from gravcomp.bench.campaign import SAFE_TIMEOUT, Campaign
from gravcomp.bench.fault_cases import CASES, Case, send_signal
from gravcomp.bench.hostile_frames import send_hostile_frames
from gravcomp.launcher.virtual_graph import NODES, RunningGraph

_RECOVERY = 5.0  # s, from the restart of a process to the first followed command
_STOPS = 10
_DIAGNOSTICS = 2.5  # s, in which the next ones arrive
_MESSAGE_SHARE = 0.05  # of the hostile frames and messages


def run(
    progress: Callable[[str], None],
    *,
    kills: int = 20,
    frames: int = 1_000_000,
    seed: int = 1,
    every: int = 1,
    stops: int = _STOPS,
    pause: float = 1.0,
) -> dict:
    """Run the campaign and return its figures; the names of the keys give their units.

    kills: of each process; frames: hostile frames and messages; every: only every `every`-th fault; stops: calls of
    ~/stop; pause: longest pause in s around a kill, and twice as long under a fault without a safe response.
    """
    with RunningGraph({"virtual_robot": {"motion": "tremor"}}) as graph:  # keeps the motors working
        progress("starting the graph")
        graph.wait_for_commands()
        campaign = Campaign(graph, seed)
        try:
            safe, unanswered, stuck = _faults(campaign, CASES[::every], stops, pause, progress)
            recovery, kill_safe, late = _kills(campaign, kills, pause, progress)
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


def _faults(
    campaign: Campaign, cases: tuple[Case, ...], stop_count: int, pause: float, progress: Callable[[str], None]
) -> tuple[dict, list, list]:
    """Return ms to the response by fault, the faults without one, and those after which commands were not followed again."""
    safe: dict[str, float | None] = {}
    unanswered, stuck = [], []
    for case in cases:
        if not campaign.make_active():
            stuck.append(f"before {case.name}")
        progress(f"fault: {case.name}")
        time.sleep(campaign.random.uniform(0.0, 0.5 * pause))
        if case.zero is None:
            case.inject(campaign)
            time.sleep(2.0 * pause)
        else:
            elapsed = case.time_to_safe(campaign)
            if elapsed is None:
                unanswered.append(case.name)
            else:
                safe[case.name] = round(elapsed, 1)
        campaign.clear_faults()
        campaign.note_dead()
        if not campaign.make_active():
            stuck.append(case.name)
    progress("stop")
    stops = [_stop(campaign) for _ in range(stop_count)]
    if None in stops:
        unanswered.append("stop")
    safe["stop"] = max((round(t, 1) for t in stops if t is not None), default=None)
    campaign.make_active()
    return safe, unanswered, stuck


def _stop(campaign: Campaign) -> float | None:
    """Return ms from the call of ~/stop to zero current on the bus, or None."""
    campaign.make_active()
    answer = campaign.probe.call("can_bridge/stop")
    zero = campaign.monitor.zero_since(answer["sent"], SAFE_TIMEOUT)
    return None if zero is None else 1e3 * (zero - answer["sent"])


def _kills(
    campaign: Campaign, kills: int, pause: float, progress: Callable[[str], None]
) -> tuple[list[tuple[str, float | None]], dict, list[str]]:
    """Kill and restart processes at random.

    Return process and recovery time (s) of each kill, None without recovery; the worst time to the response (ms) by process; the
    messages of the bridge at recoveries that took too long.
    """
    order = [name for name in NODES for _ in range(kills)]
    campaign.random.shuffle(order)
    recovery: list[tuple[str, float | None]] = []
    worst: dict[str, float] = {}
    late = []
    for number, executable in enumerate(order, 1):
        progress(f"kill {number} of {len(order)}: {executable}")
        # Otherwise the response would appear late, because the probe has not found the restarted bridge yet.
        campaign.probe.match()
        zero = executable in ("can_bridge", "virtual_robot")
        elapsed = campaign.time_to_safe(send_signal(executable, signal.SIGKILL), zero=zero)
        if elapsed is not None:
            key = f"{executable} killed"
            worst[key] = max(worst.get(key, 0.0), round(elapsed, 1))
        time.sleep(campaign.random.uniform(0.0, pause))
        campaign.graph.restart(executable)
        begin = time.time()
        followed = campaign.monitor.trace_after(begin, _RECOVERY)
        if followed is None:
            late.append(f"{executable}: {campaign.probe.states[-1].message if campaign.probe.states else 'no state'}")
            campaign.make_active()
            followed = time.time() if campaign.monitor.trace_after(begin, 1.0) else None
        recovery.append((executable, None if followed is None else round(followed - begin, 2)))
        campaign.note_dead()
        time.sleep(campaign.random.uniform(0.2 * pause, pause))
    return recovery, worst, late


def _hostile(campaign: Campaign, total: int, progress: Callable[[str], None]) -> dict:
    """Send hostile frames and messages in rounds, and bring the bridge back to ACTIVE between them."""
    messages = int(total * _MESSAGE_SHARE)
    rounds = max(1, total // 50_000)
    before = _received(campaign)
    for number in range(rounds):
        progress(f"hostile frames and messages: round {number + 1} of {rounds}")
        campaign.make_active(5.0)
        send_hostile_frames(campaign.monitor.link, campaign.random, (total - messages) // rounds)
        campaign.probe.flood(messages // rounds)
        campaign.probe.fault()
        campaign.note_dead()
    taken = _received(campaign) - before  # not meaningful after a crash
    return {"sent": rounds * ((total - messages) // rounds + messages // rounds), "taken": taken}


def _received(campaign: Campaign) -> int:
    """Return the frames that the bridge has received, by its next diagnostics: their number grows with each of them."""

    def known() -> int:
        return int(campaign.probe.count()["bridge"].get("frames_received", 0))

    last, end = known(), time.monotonic() + _DIAGNOSTICS
    while (now := known()) == last and time.monotonic() < end:
        time.sleep(0.05)
    return now
