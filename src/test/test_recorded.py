"""`gravcomp reproduce NAME --bag`: the figures of a recording are those that were put into it."""

import json
import shutil

import numpy as np
import pytest
from bag_of_topics import TopicBag

from gravcomp.calibration.course import predict_course
from gravcomp.calibration.measured import Measured
from gravcomp.commands.__main__ import main
from gravcomp.description import load_robot_file
from gravcomp.inverse import ControllerCode, bend_target

pytestmark = pytest.mark.slow

LENGTH = 0.1  # m
HORIZONTAL = np.array([-9.81, 0.0, 0.0])
RELAXING, KEPT = int(ControllerCode.RELAXING), int(ControllerCode.OK)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def reproduce(capsys, name: str, *arguments: str) -> dict:
    """The figures by name; the page is there."""
    assert main(["reproduce", name, "--bag", "bag", "--out", "pages", "--json", *arguments]) in (0, 1)
    (result,) = json.loads(capsys.readouterr().out.splitlines()[-1])["experiments"]
    return {figure["name"]: figure["value"] for figure in result["figures"]}


def refused(capsys, *arguments: str) -> str:
    assert main(["reproduce", *arguments, "--out", "pages"]) == 2
    return " ".join(capsys.readouterr().err.split())


def held_and_released(path, tip_topic: str = "/measured/tip") -> None:
    """4 s released with a sag of 20 mm, 4 s straight with errors of 0.6 mm across and 1 mm along, 4 s bent with 0.5 mm across.

    The model is off by 0.3 mm.
    """
    target = bend_target(LENGTH, 0.5, 0.0)
    phases = [
        (RELAXING, np.array([-0.020, 0.0, 0.097])),
        (KEPT, np.array([0.0006, 0.0, LENGTH - 0.001])),
        (KEPT, target.tip_position + np.array([0.0, 0.0005, 0.0])),
    ]
    half = 0.25  # rad: the tip's frame of a bend of 0.5 rad
    with TopicBag(path) as bag:
        for i in range(600):  # 50 Hz
            time, phase = 100.0 + 0.02 * i, i // 200
            code, tip = phases[phase]
            if i == 400:
                bag.bend("/target/shape", time, 0.5, 0.0)
            bag.vector("/gravity", time, HORIZONTAL)
            bag.status("/controller/status", time, code)
            bag.pose(tip_topic, time, tip, (0.0, np.sin(half), 0.0, np.cos(half)) if phase == 2 else (0.0, 0.0, 0.0, 1.0))
            bag.pose("/robot/tip", time, tip + np.array([0.0003, 0.0, 0.0]))


@pytest.fixture(scope="module")
def held_bag(tmp_path_factory):
    """The bag of `held_and_released`, written once."""
    path = tmp_path_factory.mktemp("held") / "bag"
    held_and_released(path)
    return path


def test_a_recorded_robot_is_evaluated_released_and_held(here, held_bag, capsys):
    shutil.copytree(held_bag, here / "bag")
    figures = reproduce(capsys, "static")
    released = np.hypot(20.0, 3.0)
    held = np.sqrt((400 * (0.6**2 + 1.0) + 400 * 0.5**2) / 800)
    assert figures["tip error released, RMS over the whole time"] == pytest.approx(released, rel=0.01)
    assert figures["tip error held, RMS over the whole time"] == pytest.approx(held, rel=0.01)
    assert figures["tip error smaller than released by the factor"] == pytest.approx(released / held, rel=0.02)
    assert figures["largest lateral error at rest, held"] == pytest.approx(0.6, rel=1e-3)
    assert figures["largest tilt of the tip at rest, held"] == pytest.approx(0.0, abs=1e-6)
    # A model that is off by the same everywhere correlates fully.
    assert figures["recovery rate r at rest"] == pytest.approx(1.0, abs=1e-9)
    page = (here / "pages" / "static-recorded.html").read_text(encoding="utf-8")
    assert "target shape" in page and "<svg" in page and "the robot" in page


def test_a_report_says_when_the_tip_is_a_virtual_robots(here, capsys):
    held_and_released(here / "bag", "/truth/tip")
    reproduce(capsys, "arm")
    assert "the virtual robot" in (here / "pages" / "arm-recorded.html").read_text(encoding="utf-8")


def test_the_tip_may_be_on_a_topic_of_any_name(here, capsys):
    held_and_released(here / "bag", "/camera/tip")
    assert "has no geometry_msgs/msg/PoseStamped on 'measured/tip' or 'truth/tip'" in refused(capsys, "static", "--bag", "bag")
    reproduce(capsys, "static", "--tip-topic", "/camera/tip")


def test_a_recorded_fall_is_followed_by_the_model(here, capsys):
    """The model's own fall, held straight by hand for 1.5 s before.

    The evaluation must find the moment of letting go: 10 ms are 7 mm at the highest speed.
    """
    robot = load_robot_file("article").robot
    count = 150  # 1.5 s
    straight = Measured(
        source="straight until it is let go",
        trial=np.zeros(count, int),
        time=0.01 * np.arange(count),
        gravity=np.tile(HORIZONTAL, (count, 1)),
        displacement=np.full((count, len(robot.cables)), np.nan),
        tip_position=np.tile([0.0, 0.0, LENGTH], (count, 1)),
    )
    tip, direction = predict_course(robot, straight)
    with TopicBag(here / "bag") as bag:
        for i in range(150 + len(tip)):
            time, k = 50.0 + 0.01 * i, max(0, i - 150)
            x, y, z = direction[k]
            turn = np.array([-y, x, 0.0, 1.0 + z])  # the smallest rotation from the axis to the direction
            bag.vector("/gravity", time, HORIZONTAL)
            bag.status("/controller/status", time, RELAXING)
            bag.pose("/measured/tip", time, tip[k], turn / np.linalg.norm(turn))
            bag.pose("/robot/tip", time, tip[k])
    figures = reproduce(capsys, "real2sim")
    assert figures["worst position error over the whole fall"] < 1.5
    assert figures["worst direction error over the whole fall"] < 1.5
    assert figures["worst position error at rest"] < 0.1


def test_robots_that_cables_let_down_do_not_fall(here, held_bag, capsys):
    shutil.copytree(held_bag, here / "bag")
    assert "contains no fall" in refused(capsys, "real2sim", "--bag", "bag")


def test_delays_are_those_between_stamp_and_reception(here, capsys):
    with TopicBag(here / "bag") as bag:
        for i in range(500):
            bag.command("/cable/command", 10.0 + 0.01 * i, np.zeros(6), late=0.004)
            bag.state("/cable/state", 10.0 + 0.01 * i, np.zeros(6), late=0.009)
    figures = reproduce(capsys, "delay")
    assert figures["cables commanded, median"] == pytest.approx(4.0, abs=1e-3)
    assert figures["command followed, by the state of the bridge, 99th percentile"] == pytest.approx(9.0, abs=1e-3)


def test_an_imu_at_rest_is_filtered_and_integrated(here, capsys):
    """A bias of 0.1 deg/s about the vertical drifts by 6 deg in a minute when it is integrated; the filter learns it."""
    random = np.random.default_rng(3)
    with TopicBag(here / "bag") as bag:
        for i in range(4500):  # 50 Hz
            gyro = np.radians([0.0, 0.0, 0.1]) + 1e-3 * random.standard_normal(3)
            bag.imu("/imu/data_raw", 1.0 + 0.02 * i, gyro, [0.0, 0.0, 9.81] + 0.01 * random.standard_normal(3))
    figures = reproduce(capsys, "imu-ablation")
    assert figures["yaw drift at rest, raw rate integrated"] == pytest.approx(7.0, abs=0.3)  # over 70 s
    assert figures["yaw drift at rest, with filter"] < 0.7


def test_a_bag_that_cannot_be_evaluated_is_refused_with_the_reason(here, capsys):
    assert "`gravcomp calibrate BAG`" in refused(capsys, "tuning", "--bag", "bag")
    assert "nowhere" in refused(capsys, "static", "--bag", "nowhere")
    with TopicBag(here / "bag") as bag:
        for i in range(50):
            bag.command("/cable/command", 10.0 + 0.01 * i, np.zeros(6), late=-5.0)
    assert "another clock" in refused(capsys, "delay", "--bag", "bag")
    assert "--write" in refused(capsys, "static", "--bag", "bag", "--write", "figures.md")


def test_all_evaluates_what_a_bag_contains_and_names_the_rest(here, held_bag, capsys):
    shutil.copytree(held_bag, here / "bag")
    assert main(["reproduce", "all", "--bag", "bag", "--out", "pages", "--json"]) in (0, 1)
    printed = capsys.readouterr()
    assert [r["name"] for r in json.loads(printed.out.splitlines()[-1])["experiments"]] == ["static"]
    assert "delay: bag: has no" in " ".join(printed.err.split())
