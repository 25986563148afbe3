"""`gravcomp record`: the graph's topics into a bag (MCAP, rosbag2 version 9) until Ctrl-C."""

import argparse
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

# How long the recorder may take to write the bag's end.
_PATIENCE = 20.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Record the graph that runs on this machine into a bag that `ros2 bag` reads; a kill loses at most a second."
    )
    parser.add_argument("--out", metavar="DIR", help="folder of the bag, which must not exist (default: gravcomp_DATE_TIME here)")
    parser.add_argument("--topics", nargs="+", default=[], metavar="TOPIC", help="only these (default: all)")
    parser.add_argument("--namespace", default="", metavar="NS", help="of the robot, for one of several (default: /)")
    parser.add_argument("--duration", type=float, metavar="S", help="end after so many seconds (default: at Ctrl-C)")
    parser.add_argument("--json", action="store_true", help="print what was recorded as one JSON object, the last line")


def run(args: argparse.Namespace) -> int:
    """Run the command; 0: a bag was written, 2: it could not be."""
    from datetime import datetime

    from gravcomp.config import ConfigError
    from gravcomp.launcher import NodeSpec

    if args.duration is not None and args.duration <= 0.0:
        raise ConfigError(f"--duration is {args.duration:g}; more than 0 s is needed")
    out = Path(args.out or f"gravcomp_{datetime.now():%Y%m%d_%H%M%S}").resolve()
    parameters = {"out": str(out), **({"topics": args.topics} if args.topics else {})}
    spec = NodeSpec("gravcomp_fem", "recorder", parameters, args.namespace)
    # Its own session: Ctrl-C comes here first and is handed on once.
    recorder = subprocess.Popen(spec.command(), start_new_session=True)
    try:
        _wait(recorder, out, args.duration)
    finally:
        if recorder.poll() is None:
            recorder.send_signal(signal.SIGINT)
        code = recorder.wait(_PATIENCE)
    if code:
        return 2
    figures = describe(out)
    _print_summary(figures)
    if args.json:
        print(json.dumps(figures), flush=True)
    return 0


def describe(path: Path) -> dict:
    """What is in a bag: duration and messages by topic."""
    from rosbags.rosbag2 import Reader

    with Reader(path) as bag:
        topics = {name: info.msgcount for name, info in sorted(bag.topics.items())}
        return {"bag": str(path), "messages": bag.message_count, "duration_s": round(bag.duration * 1e-9, 3), "topics": topics}


def _wait(recorder: subprocess.Popen, out: Path, duration: float | None) -> None:
    """Until the recorder ends, Ctrl-C, or `duration` s after the bag has begun."""
    end = None
    try:
        while recorder.poll() is None and (end is None or time.monotonic() < end):
            if end is None and duration is not None and out.exists():
                end = time.monotonic() + duration
            time.sleep(0.1)
    except KeyboardInterrupt:
        pass


def _print_summary(figures: dict) -> None:
    print(f"{figures['bag']}: {figures['messages']} messages, {figures['duration_s']:.1f} s", file=sys.stderr)
    for topic, count in figures["topics"].items():
        print(f"  {count:8d}  {topic}", file=sys.stderr)
