"""Check of the running graph, by a process of its own, because the core does not import ROS."""

import json
import subprocess

from gravcomp.doctor.finding import Finding
from gravcomp.launcher import NodeSpec

_TIMEOUT = 60.0  # s


def examine(namespace: str = "") -> list[Finding]:
    """Return the findings on rate, latency and QoS compatibility of every topic with a nominal rate."""
    command = NodeSpec("gravcomp_hw", "graph_probe", namespace=namespace).module_command()
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT)
        return [Finding(**entry) for entry in json.loads(done.stdout.strip().splitlines()[-1])]
    except (subprocess.TimeoutExpired, ValueError, IndexError):
        return [Finding("missing", "graph", "could not be checked: the probe gave no answer")]
