"""The doctor where no graph runs, in a ROS domain of its own."""

import pytest

pytest.importorskip("rclpy", reason="it looks for a running graph: ./gravcomp test")

from gravcomp.graph.nodes import NODES
from gravcomp.launcher.domain import reserve_domain

pytestmark = pytest.mark.nodes


def test_the_doctor_reports_that_nothing_runs(gravcomp):
    answer = gravcomp("doctor", "--graph", "--json", ROS_DOMAIN_ID=reserve_domain())
    assert answer.code == 1
    silent = {f["subject"] for f in answer.json["findings"] if f["found"] == "nothing is published"}
    assert silent == {port.name for entry in NODES for port in entry.publishes if port.rate is not None}
