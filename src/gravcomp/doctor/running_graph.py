"""The running graph, seen by a process of its own, because the core knows no ROS."""

import json
import subprocess

from gravcomp.doctor.finding import Finding
from gravcomp.launcher import NodeSpec

_TIMEOUT = 60.0  # s


def examine(namespace: str = "") -> list[Finding]:
    """Rates, delays and fitting QoS of every topic that keeps a rate."""
    command = NodeSpec("gravcomp_hw", "graph_probe", namespace=namespace).module_command()
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT)
        return [Finding(**entry) for entry in json.loads(done.stdout.strip().splitlines()[-1])]
    except (subprocess.TimeoutExpired, ValueError, IndexError):
        return [Finding("missing", "graph", "could not be looked at")]
