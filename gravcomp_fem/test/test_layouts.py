"""The layouts for RViz, Foxglove and PlotJuggler are readable, and their topics, services and message fields exist."""

import importlib
import json
import re
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest
import yaml

from gravcomp.description import load_robot_file
from gravcomp.graph.nodes import NODES

CONFIG = Path(__file__).resolve().parents[1] / "config"
TOPICS = {port.name: port.type for entry in NODES for port in (*entry.subscribes, *entry.publishes)}
SERVICES = {port.name.replace("~", f"/{entry.executable}"): port.type for entry in NODES for port in entry.services}
SHOWN_AS = {
    "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
    "rviz_default_plugins/Pose": "geometry_msgs/msg/PoseStamped",
    "rviz_default_plugins/PoseArray": "geometry_msgs/msg/PoseArray",
    "rviz_default_plugins/RobotModel": "std_msgs/msg/String",
}


def topic_type(name: str) -> str:
    """Return the type of a topic, given with or without its leading slash."""
    kind = TOPICS.get(name) or TOPICS.get(name.lstrip("/"))
    assert kind, f"no topic {name}"
    return kind


def check_field(topic: str, path: list[str]) -> None:
    """Check that a message of the topic has the field, e.g. ['cable_tension[5]'] or ['vector', 'x']."""
    package, _, name = topic_type(topic).split("/")
    kind = getattr(importlib.import_module(f"{package}.msg"), name)
    for step in path:
        field, index = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", step).groups()
        fields = kind.get_fields_and_field_types()
        assert field in fields, f"{topic} has no field {field}; it has {', '.join(fields)}"
        if index is not None:
            assert fields[field].startswith("sequence<") and int(index) < len(load_robot_file("article").robot.cables)
        elif "/" in fields[field]:
            package, name = fields[field].split("/")
            kind = getattr(importlib.import_module(f"{package}.msg"), name)


def test_rviz_shows_topics_of_their_types():
    manager = yaml.safe_load((CONFIG / "gravcomp.rviz").read_text(encoding="utf-8"))["Visualization Manager"]
    found = {}
    for display in manager["Displays"]:
        topic = (display.get("Topic") or display.get("Description Topic") or {}).get("Value")
        if topic:
            assert topic_type(topic) == SHOWN_AS[display["Class"]]
            found[topic] = display["Class"]
    assert {"robot/markers", "robot/tip", "target", "truth/backbone", "robot_description"} <= set(found)
    # Relative: with `-r __ns:=/left` it shows the robot of that namespace.
    assert not any(topic.startswith("/") for topic in found)


def test_foxglove_shows_topics_fields_and_services_that_exist():
    layout = json.loads((CONFIG / "foxglove.json").read_text(encoding="utf-8"))
    panels = layout["configById"]
    placed = re.findall(r'"(\w+!\w+)"', json.dumps(layout["layout"]))
    assert sorted(placed) == sorted(panels)
    for name, panel in panels.items():
        kind = name.partition("!")[0]
        if kind == "Plot":
            for path in panel["paths"]:
                topic, *fields = path["value"].split(".")
                check_field(topic, fields)
        elif kind == "CallService":
            assert panel["serviceName"] in SERVICES
            json.loads(panel["requestPayload"])
        elif kind == "DiagnosticSummary":
            topic_type(panel["topicToRender"])
        else:
            assert kind == "3D"
            for topic in panel["topics"]:
                topic_type(topic)


def test_plotjuggler_plots_fields_that_exist():
    curves = [curve.get("name") for curve in xml.parse(CONFIG / "plotjuggler.xml").iter("curve")]
    assert curves
    for curve in curves:
        # The topic is the longest beginning of the curve's name that is one.
        topic = max((f"/{name}" for name in TOPICS if curve.startswith(f"/{name}/")), key=len, default=None)
        assert topic, f"{curve} is of no topic"
        check_field(topic, curve[len(topic) + 1 :].split("/"))


@pytest.mark.parametrize("path", sorted(CONFIG.iterdir()), ids=lambda path: path.name)
def test_every_layout_is_described(path):
    assert path.name in (CONFIG.parents[1] / "src" / "doc" / "tools.md").read_text(encoding="utf-8")


def test_each_node_is_in_one_group_of_the_diagnostics():
    groups = yaml.safe_load((CONFIG / "diagnostics.yaml").read_text(encoding="utf-8"))["/**"]["ros__parameters"]
    contained = [name for group in groups.values() if isinstance(group, dict) for name in group["contains"]]
    assert sorted(contained) == sorted(entry.executable for entry in NODES if entry.executable != "judge")
