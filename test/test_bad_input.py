"""Invalid input gives a clear message and exit code 2, and nothing hangs."""

import numpy as np
import pytest
import yaml

from gravcomp.config import ConfigError
from gravcomp.description import shipped_robots
from gravcomp.launcher.robot_graph import check_robot_file


def changed_robot(tmp_path, change) -> str:
    document = yaml.safe_load(shipped_robots()["article"].read_text(encoding="utf-8"))
    change(document)
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return str(path)


def refused(answer, *words: str) -> None:
    assert answer.code not in (0, None)
    assert "Traceback" not in answer.err
    for word in words:
        assert word in answer.err, answer.err


def test_a_recording_that_cannot_be_used_is_refused(gravcomp, tmp_path):
    refused(gravcomp("demo", "--headless", "--imu", str(tmp_path / "none.npz")), "none.npz", "does not exist")
    text = tmp_path / "text.npz"
    text.write_text("no arrays", encoding="utf-8")
    refused(gravcomp("demo", "--headless", "--imu", str(text)), "text.npz")
    shape = tmp_path / "shape.npz"
    np.savez(shape, gyr=np.zeros((100, 2)), acc=np.zeros((100, 3)), rate=100.0)
    refused(gravcomp("demo", "--headless", "--imu", str(shape)), "shape.npz", "gyr", "(100, 2)")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d["robot"].update(colour="red"), ["robot.colour", "robot.yaml"]),
        (lambda d: d["robot"]["segments"][0].update(length_mm=-5), ["robot.segments[0].length_mm", "-5", "mm"]),
        (lambda d: d["hardware"]["motors"][0].update(can_id=9), ["hardware.motors[0].can_id", "9", "8"]),
        (lambda d: d["virtual_robot"]["body"].update(youngs_modulus_mpa="soft"), ["youngs_modulus_mpa", "'soft'"]),
        (lambda d: d.update(nodes={"fem_simulator": {"marker_rate": 1000.0}}), ["marker_rate", "1000", "10"]),
        (lambda d: d.update(nodes={"fem_simulator": {"marker_speed": 1.0}}), ["marker_speed"]),
    ],
)
def test_a_robot_file_with_a_mistake_is_refused(tmp_path, change, words):
    """By what demo, up and arm ask before they start a node."""
    with pytest.raises(ConfigError) as error:
        check_robot_file(changed_robot(tmp_path, change))
    assert all(word in str(error.value) for word in words), error.value


def test_a_mistake_in_the_section_of_a_node_is_refused_before_any_node_starts(gravcomp, tmp_path):
    wrong = changed_robot(tmp_path, lambda d: d.update(nodes={"fem_simulator": {"marker_rate": 1000.0}}))
    answer = gravcomp("demo", "--headless", "--robot", wrong)
    refused(answer, "robot.yaml: nodes.fem_simulator", "marker_rate", "1000")
    assert "ended with code" not in answer.err  # as a node that refuses it


def test_a_device_that_does_not_exist_is_refused_before_any_node_starts(gravcomp):
    answer = gravcomp("up", "--interface", "socketcan", "--channel", "nocan7")
    refused(answer, "nocan7", "ip link set")
    assert "ended with code" not in answer.err


@pytest.mark.graph
def test_an_interface_that_does_not_exist_is_refused(gravcomp):
    refused(gravcomp("up", "--interface", "carrier_pigeon", "--channel", "1"), "carrier_pigeon", "can_bridge")


def test_unknown_commands_and_options_are_refused(gravcomp):
    refused(gravcomp("fly"), "fly", "demo")
    refused(gravcomp("demo", "--duration", "1"), "--duration", "10")
    refused(gravcomp("demo", "--robot", "nobody"), "nobody", "article")
    refused(gravcomp("demo", "--headless", "--screenshots", "pictures"), "--screenshots", "--headless")
