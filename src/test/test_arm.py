"""The arm: forward kinematics of its URDF, gravity in the robot's base, the tour, the shipped macro."""

import argparse
import contextlib
import math
from pathlib import Path

import numpy as np
import pytest

from gravcomp.arm import description
from gravcomp.arm.chain import Chain, angle_between
from gravcomp.arm.description import expanded
from gravcomp.arm.shape_chain import joint_names, joint_positions
from gravcomp.arm.tour import FIVE_POSES, Tour
from gravcomp.commands import arm as arm_command
from gravcomp.commands import preparation
from gravcomp.config import ConfigError
from gravcomp.description import load_robot_file
from gravcomp.launcher import host_client
from gravcomp.standard_gravity import STANDARD_GRAVITY

URDF = Path(__file__).resolve().parents[2] / "gravcomp_fem" / "urdf"

TWO_JOINTS = """<robot name="r"><link name="world"/><link name="a"/><link name="b"/><link name="soft_base"/>
<joint name="j1" type="revolute">
    <parent link="world"/><child link="a"/><origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="0 2 0"/>
</joint>
<joint name="j2" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
<joint name="j3" type="fixed">
    <parent link="b"/><child link="soft_base"/><origin xyz="0.5 0 0" rpy="0 0 1.5707963267948966"/>
</joint></robot>"""


@pytest.fixture(scope="module")
def arm():
    return expanded(URDF / "seven_axis_arm.urdf.xacro")


def test_a_pose_is_the_product_of_its_joints():
    chain = Chain(TWO_JOINTS, "soft_base", "world")
    assert chain.moving == ("j1", "j2")
    pose = chain.pose({"j1": math.pi / 2, "j2": 0.2})
    np.testing.assert_allclose(pose[:3, 3], [0.2, 0.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3] @ [0, 0, 1], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-12)


def test_gravity_points_down_in_the_root(arm):
    chain = Chain(arm, "soft_base", "world")
    random = np.random.default_rng(0)
    for _ in range(20):
        q = dict(zip(chain.moving, random.uniform(-2, 2, 7)))
        np.testing.assert_allclose(chain.pose(q)[:3, :3] @ chain.gravity(q), [0, 0, -STANDARD_GRAVITY], atol=1e-12)


def test_the_root_may_be_any_link_above():
    assert Chain(TWO_JOINTS, "soft_base", "a").moving == ("j2",)
    assert Chain(TWO_JOINTS, "soft_base").root == "world"


@pytest.mark.parametrize(
    ("urdf", "tip", "root", "sentence"),
    [
        ("<robot", "soft_base", None, "is not a URDF"),
        (TWO_JOINTS, "soft_tip", None, "has no link 'soft_tip'; it has: world, a, b, soft_base"),
        (TWO_JOINTS, "soft_base", "table", "has no link 'table'"),
        (TWO_JOINTS, "a", "b", "link 'a' is not below 'b' in the tree; its root is 'world'"),
        (TWO_JOINTS.replace('<parent link="b"/>', ""), "soft_base", None, "joint 'j3' has no parent link"),
        (TWO_JOINTS.replace("revolute", "floating"), "soft_base", None, "joint 'j1' is of type 'floating'"),
        (
            TWO_JOINTS.replace('<link name="b"/>', '<link name="b"/><link name="table"/>'),
            "soft_base",
            None,
            "several roots, the links world, table",
        ),
        (TWO_JOINTS.replace('<parent link="world"/>', '<parent link="b"/>'), "soft_base", None, "links a, b are a loop"),
        (
            TWO_JOINTS.replace('<child link="b"/>', '<child link="a"/>'),
            "soft_base",
            None,
            "link 'a' is below two joints, 'j1' and 'j2'",
        ),
        (TWO_JOINTS.replace('<link name="b"/>', 2 * '<link name="b"/>'), "soft_base", None, "two links of the name 'b'"),
        (TWO_JOINTS.replace("j2", "j1"), "soft_base", None, "two joints of the name 'j1'"),
        (TWO_JOINTS.replace('<link name="a"/>', ""), "soft_base", None, "joint 'j1' has the child link 'a', which is not in it"),
        (TWO_JOINTS.replace("0.5 0 0", "0.5 0"), "soft_base", None, "joint 'j3' has xyz '0.5 0'; three numbers are needed"),
        (TWO_JOINTS.replace("0 2 0", "0 0 0"), "soft_base", None, "joint 'j1' has an axis of length 0"),
    ],
)
def test_the_error_says_what_is_wrong_with_a_urdf(urdf, tip, root, sentence):
    with pytest.raises(ConfigError, match=sentence):
        Chain(urdf, tip, root)


def test_the_five_poses_are_the_articles_directions(arm):
    chain = Chain(arm, "soft_base", "world")
    for inclination, joints in FIVE_POSES.items():
        axis = chain.pose(dict(zip(chain.moving, joints)))[:3, 2]
        # Beyond the vertical the robot leans backwards: the same angle to the ground, away from the arm's front.
        expected = min(inclination, 180.0 - inclination)
        assert math.degrees(math.asin(axis[2])) == pytest.approx(expected, abs=0.02)
        assert (axis[0] < -0.1) == (inclination > 90.0)


def test_the_tour_rests_at_its_poses_and_never_jumps():
    poses = np.array(list(FIVE_POSES.values()))
    tour = Tour(poses, travel=2.0, hold=3.0)
    assert tour.duration == 25.0
    times = np.arange(0.0, 50.0, 0.01)
    positions = np.array([tour.positions(t) for t in times])
    # Minimum jerk peaks at 15/8 of the mean speed.
    ways = np.abs(poses - np.roll(poses, 1, axis=0)).max()
    assert np.abs(np.diff(positions, axis=0)).max() <= 1.875 * ways / 2.0 * 0.01 * 1.001
    assert [tour.at_rest(t, 2.0) for t in (0.0, 3.9, 4.1, 9.5, 29.5)] == [None, None, 0, 1, 0]
    # More to measure than the rest lasts: the motion is not measured.
    assert [tour.at_rest(t, -0.5) for t in (1.7, 2.1)] == [None, 0]
    np.testing.assert_allclose(tour.positions(14.0), poses[2])


def test_the_macro_takes_prefix_parent_and_origin(tmp_path):
    own = tmp_path / "own.urdf.xacro"
    own.write_text(
        f"""<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro">
    <xacro:include filename="{URDF}/soft_robot.urdf.xacro"/>
    <link name="table"/>
    <xacro:soft_robot prefix="left_" joint_prefix="left_" parent="table">
        <origin xyz="0 0.2 0" rpy="0 {math.pi / 2} 0"/>
    </xacro:soft_robot>
    <xacro:soft_robot prefix="right_" joint_prefix="right_" parent="table">
        <origin xyz="0 -0.2 0" rpy="0 0 0"/>
    </xacro:soft_robot></robot>""",
        encoding="utf-8",
    )
    urdf = expanded(own)
    left, right = (Chain(urdf, f"{side}_imu_link", "table") for side in ("left", "right"))
    np.testing.assert_allclose(left.pose({})[:3, 3], [0, 0.2, 0])
    assert angle_between(left.gravity({}), right.gravity({})) == pytest.approx(math.pi / 2)
    assert 'name="left_s2c3"' in urdf


def test_the_macros_joints_are_the_robots_cables():
    urdf = expanded(URDF / "soft_robot_alone.urdf.xacro")
    for name in load_robot_file("article").robot.cable_names:
        assert f'<joint name="{name}" type="prismatic">' in urdf


@pytest.mark.parametrize(("robot", "cables"), [("article", ("left_s1c1", "left_s2c3")), ("three_segment", ("left_s3c1",))])
def test_the_macro_takes_the_robot_from_its_file_and_shows_its_shape(tmp_path, robot, cables):
    file = load_robot_file(robot)
    own = tmp_path / "own.urdf.xacro"
    own.write_text(
        f"""<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro">
    <xacro:include filename="{URDF}/soft_robot.urdf.xacro"/>
    <link name="table"/>
    <xacro:soft_robot name="left" parent="table" robot_yaml="{file.source}"><origin xyz="0 0 0"/></xacro:soft_robot>
    </robot>""",
        encoding="utf-8",
    )
    urdf = expanded(own)
    assert all(f'<joint name="{cable}" type="prismatic">' in urdf for cable in cables)
    imu = Chain(urdf, "left_imu_link", "left_soft_base").pose({})
    np.testing.assert_allclose(imu[:3, :3], file.robot.imu_mount.rotation, atol=1e-9)
    count = len(file.robot.effectors.backbone_station)
    angle = np.linspace(0.0, 1.2, count)
    bent = file.robot.length * 0.9 * np.column_stack([1 - np.cos(angle), 0.3 * angle**2, np.sin(angle)]) / 1.2
    positions = dict(zip(joint_names("left_", count), joint_positions(bent, file.robot.length)))
    for i in (1, count // 2, count - 1):
        chain = Chain(urdf, f"left_chain_{i}", "left_soft_base")
        np.testing.assert_allclose(chain.pose(positions)[:3, 3], bent[i] - bent[0], atol=1e-9)


def test_a_broken_xacro_is_named(tmp_path):
    bad = tmp_path / "bad.xacro"
    bad.write_text(
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="${nothing}"/></robot>', encoding="utf-8"
    )
    with pytest.raises(ConfigError, match=r"bad\.xacro"):
        expanded(bad)


def test_the_command_expands_an_own_arm_once(monkeypatch):
    class Reached(Exception):
        pass

    def reached(urdf):
        raise Reached(urdf.read_text(encoding="utf-8"))

    paths = []
    monkeypatch.setattr(description, "expanded", lambda path: paths.append(path) or expanded(path))
    monkeypatch.setattr(host_client, "NodeHost", contextlib.nullcontext)
    monkeypatch.setattr(preparation, "prepare", lambda *_, **__: None)
    monkeypatch.setattr(arm_command, "_start_of_tour", reached)
    parser = argparse.ArgumentParser()
    arm_command.add_arguments(parser)
    own = URDF / "seven_axis_arm.urdf.xacro"
    with pytest.raises(Reached) as found:
        arm_command.run(parser.parse_args(["--xacro", str(own)]))
    assert str(found.value) == expanded(own) and paths == [own]
