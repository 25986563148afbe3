"""`gravcomp record`: record the graph's topics into a bag (MCAP, rosbag2 version 9) until Ctrl-C."""

import argparse
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from gravcomp.commands import output
from gravcomp.commands.folders import made_folder
from gravcomp.commands.parsers import in_range, namespace

_RECORDER_TIMEOUT = 20.0  # s that the recorder has to write the end of the bag


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Record the graph that runs on this machine into a bag that `ros2 bag` reads. "
        "At most the last second is lost when the process is killed."
    )
    parser.add_argument("--out", metavar="DIR", help="new folder for the bag (default: gravcomp_DATE_TIME in the current folder)")
    parser.add_argument("--topics", nargs="+", default=[], metavar="TOPIC", help="record these topics only (default: all)")
    parser.add_argument(
        "--namespace", type=namespace, default="", metavar="NS", help="record the robot in this namespace (default: /)"
    )
    parser.add_argument(
        "--duration",
        type=in_range(float, 0.1, 1e6, "s"),
        metavar="S",
        help="stop after this time in seconds (default: at Ctrl-C)",
    )


def run(args: argparse.Namespace) -> int:
    """Record. Returns 0: the bag is written, 2: it could not be written."""
    from datetime import datetime

    from gravcomp.launcher import NodeSpec

    out = Path(args.out or f"gravcomp_{datetime.now():%Y%m%d_%H%M%S}").resolve()
    made_folder("--out", out.parent)
    parameters = {"out": str(out), **({"topics": args.topics} if args.topics else {})}
    spec = NodeSpec("gravcomp_fem", "recorder", parameters, args.namespace)
    # In a session of its own: Ctrl-C reaches this process only, which passes it on once.
    quiet = ["--ros-args", "--log-level", "warn"] if args.quiet else []
    recorder = subprocess.Popen([*spec.command(), *quiet], start_new_session=True, stdout=sys.stderr)
    try:
        _wait(recorder, out, args.duration)
    finally:
        if recorder.poll() is None:
            recorder.send_signal(signal.SIGINT)
        code = recorder.wait(_RECORDER_TIMEOUT)
    if code:
        return 2
    figures = describe(out)
    output.result(figures, _text(figures))
    return 0


def describe(path: Path) -> dict[str, Any]:
    """Return the duration of a bag and the number of messages of each topic."""
    from rosbags.rosbag2 import Reader

    with Reader(path) as bag:
        topics = {name: info.msgcount for name, info in sorted(bag.topics.items())}
        return {"bag": str(path), "messages": bag.message_count, "duration_s": round(bag.duration * 1e-9, 3), "topics": topics}


def _wait(recorder: subprocess.Popen, out: Path, duration: float | None) -> None:
    """Wait until the recorder ends, Ctrl-C is pressed, or `duration` s have passed since the bag was begun."""
    end = None
    try:
        while recorder.poll() is None and (end is None or time.monotonic() < end):
            if end is None and duration is not None and out.exists():
                end = time.monotonic() + duration
            time.sleep(0.1)
    except KeyboardInterrupt:
        pass


def _text(figures: dict[str, Any]) -> str:
    lines = [f"{figures['bag']}: {figures['messages']} messages, {figures['duration_s']:.1f} s"]
    lines += [f"  {count:8d}  {topic}" for topic, count in figures["topics"].items()]
    return "\n".join(lines)
