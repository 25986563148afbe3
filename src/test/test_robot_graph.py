"""The nodes of a robot's graph as data: apart, in one process, with joints."""

from pathlib import Path

import pytest
import yaml

from gravcomp.config import ConfigError
from gravcomp.launcher.robot_graph import COMPOSED, LOOP, RobotGraph, check_robot_file

JOINTS = Path(__file__).resolve().parents[1] / "examples" / "joint_robot.yaml"
PARAMETERS = {"imu_estimator": {"prediction.horizon_ms": 5.0}, "can_bridge": {"trace": False}}


def names(specs):
    return tuple((spec.package, spec.executable) for spec in specs)


def test_the_inner_nodes_may_be_one_process():
    graph = RobotGraph("article", "udp_multicast", "239.1.1.1", "/left", PARAMETERS)
    assert names(graph.loop()) == LOOP
    bridge, inner = graph.loop(composed=True)
    assert names([bridge, inner]) == (LOOP[0], COMPOSED)
    assert bridge.parameters["trace"] is False and inner.namespace == "/left"
    assert inner.parameters == {"robot": "article", "imu_estimator:prediction.horizon_ms": 5.0}
    assert "imu_estimator:prediction.horizon_ms:=5.0" in inner.arguments()


def test_a_robot_with_joints_keeps_its_bridge_and_its_stand_in():
    apart = names(RobotGraph(str(JOINTS)).loop(virtual=True))
    together = names(RobotGraph(str(JOINTS)).loop(virtual=True, composed=True))
    assert together == (apart[0], COMPOSED, apart[-1]) and apart[1:-1] == LOOP[1:]


def test_a_section_of_no_node_is_refused_with_the_name_that_was_meant(tmp_path):
    """Its parameters would reach nobody."""
    document = yaml.safe_load(JOINTS.read_text(encoding="utf-8")) | {"nodes": {"fem_simulatr": {"marker_rate": 1.0}}}
    robot = tmp_path / "robot.yaml"
    robot.write_text(yaml.safe_dump(document), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"unknown key 'nodes.fem_simulatr' \(did you mean 'fem_simulator'\?\); allowed: "):
        check_robot_file(str(robot))


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ({"marker_rate": 1000.0}, "marker_rate is 1000"),
        ({"marker_speed": 1.0}, "marker_speed"),
        ([1, 2], r"nodes.fem_simulator is \[1, 2\]; a mapping of keys is needed"),
    ],
)
def test_the_sections_of_nodes_are_checked_before_any_node_starts(tmp_path, section, said):
    document = yaml.safe_load(JOINTS.read_text(encoding="utf-8")) | {"nodes": {"fem_simulator": section}}
    robot = tmp_path / "robot.yaml"
    robot.write_text(yaml.safe_dump(document), encoding="utf-8")
    with pytest.raises(ConfigError, match=said):
        check_robot_file(str(robot))
