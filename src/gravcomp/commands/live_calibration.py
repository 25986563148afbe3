"""`gravcomp calibrate --live`: the plan, the node that leads through it, and what it says, line by line."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.commands import output

if TYPE_CHECKING:
    from gravcomp.calibration.plan import Plan

_PERIOD = 0.2  # s
_END = 20.0  # s that the node has to end


def measured_live(plan: "Plan | None", folder: Path, robot: str, name: str, tip_topic: str | None, namespace: str) -> Path | None:
    """Lead through the plan on the running graph, and return the CSV file; None: interrupted, the next call goes on.

    plan: None where the one in `folder` is continued. Raises ConfigError where the node ends with an error.
    """
    from gravcomp.calibration.plan_file import save_plan
    from gravcomp.config import ConfigError
    from gravcomp.launcher import NodeSpec

    plan_path, out, state = plan_of(folder, name), folder / f"{name}-live.csv", folder / f"{name}-live.state.json"
    if plan is not None:
        try:
            save_plan(plan, plan_path)
        except OSError as error:
            raise ConfigError(f"{plan_path}: cannot be written: {error.strerror}") from error
    parameters = {"robot": robot, "plan": str(plan_path), "out": str(out), "state_file": str(state)}
    if tip_topic:
        parameters["tip_topic"] = tip_topic
    state.unlink(missing_ok=True)
    spec = NodeSpec("gravcomp_fem", "calibrator", parameters, namespace)
    node = subprocess.Popen([*spec.command(), "--ros-args", "--log-level", "warn"], start_new_session=True, stdout=sys.stderr)
    try:
        _follow(node, state)
    except KeyboardInterrupt:
        output.note(f"interrupted; the same line goes on: {out}")
        return None
    finally:
        if node.poll() is None:
            node.send_signal(signal.SIGINT)
        code = node.wait(_END)
        state.unlink(missing_ok=True)
    if code:
        raise ConfigError(f"the node calibrator ended with code {code}; its message is above")
    return out


def plan_of(folder: Path, name: str) -> Path:
    """Return the file of the plan of a live calibration."""
    return folder / f"{name}-live.plan.json"


def _follow(node: subprocess.Popen, state: Path) -> None:
    """Print what to do whenever it changes, until the node ends."""
    shown = ""
    while node.poll() is None:
        try:
            now = json.loads(state.read_text(encoding="utf-8"))["do"]
        except (OSError, ValueError, KeyError):
            now = shown
        if now != shown:
            output.note(now)
            shown = now
        time.sleep(_PERIOD)
