"""The launch files name what exists. `launch` is part of an installed ROS only; where it is there, the Python file is run."""

import re
from pathlib import Path

import pytest
import yaml

from gravcomp.graph.nodes import node

FOLDER = Path(__file__).resolve().parents[1] / "launch"
YAML = yaml.safe_load((FOLDER / "robot.launch.yaml").read_text(encoding="utf-8"))["launch"]


def test_the_yaml_file_starts_the_nodes_of_the_loop():
    from gravcomp.launcher.robot_graph import LOOP

    assert tuple((entry["node"]["pkg"], entry["node"]["exec"]) for entry in YAML if "node" in entry) == LOOP


def test_the_yaml_file_gives_parameters_that_exist_from_arguments_that_are_declared():
    arguments = {entry["arg"]["name"] for entry in YAML if "arg" in entry}
    assert all(entry["arg"]["description"] for entry in YAML if "arg" in entry)
    for entry in (entry["node"] for entry in YAML if "node" in entry):
        known = {leaf.key for leaf in node(entry["exec"]).declared_parameters()}
        assert {parameter["name"] for parameter in entry["param"]} <= known
        assert set(re.findall(r"\$\(var (\w+)\)", yaml.safe_dump(entry))) <= arguments


def nodes_of(**given: str) -> list:
    """Return the nodes that the Python file makes from arguments."""
    launch = pytest.importorskip("launch", reason="part of an installed ROS")
    pytest.importorskip("launch_ros", reason="part of an installed ROS")
    from launch.launch_description_sources import PythonLaunchDescriptionSource

    description = PythonLaunchDescriptionSource(str(FOLDER / "robot.launch.py")).get_launch_description(launch.LaunchContext())
    *declared, function = description.entities
    context = launch.LaunchContext()
    for argument in declared:
        context.launch_configurations[argument.name] = given.get(argument.name, argument.default_value[0].text)
    return [entity.node_executable for entity in function.execute(context)]


def test_the_python_file_follows_the_robot_file():
    joints = str(FOLDER.parents[1] / "src" / "examples" / "joint_robot.yaml")
    loop = ["imu_estimator", "fem_simulator", "inverse_controller"]
    assert nodes_of() == ["can_bridge", *loop]
    assert nodes_of(virtual="true", viewer="true") == ["can_bridge", *loop, "virtual_robot", "viewer"]
    assert nodes_of(composed="true") == ["can_bridge", "composed_loop"]
    assert nodes_of(virtual="true", robot=joints) == ["joint_bridge", *loop, "joint_robot", "virtual_robot"]
