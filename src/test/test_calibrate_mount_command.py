"""`gravcomp calibrate-mount`: from a bag of IMU and arm to a robot file with the mount."""

import json

import numpy as np
import pytest
from bag_of_topics import TopicBag
from scipy.spatial.transform import Rotation

from gravcomp.arm.chain import Chain
from gravcomp.commands.__main__ import main
from gravcomp.description import load_robot_file
from gravcomp.standard_gravity import STANDARD_GRAVITY

pytestmark = pytest.mark.slow

MOUNT = (3.1, -1.5, 0.2)  # roll, pitch, yaw of the IMU in soft_base
URDF = """<robot name="r"><link name="world"/><link name="a"/><link name="b"/><link name="soft_base"/>
<joint name="left_j1" type="revolute"><parent link="world"/><child link="a"/><axis xyz="0 1 0"/></joint>
<joint name="left_j2" type="revolute"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/></joint>
<joint name="left_j3" type="revolute"><parent link="b"/><child link="soft_base"/><axis xyz="0 0 1"/></joint></robot>"""
POSES = np.array([[0.1, 0.2, 0.0], [1.4, 0.1, 0.3], [-1.2, 0.4, 1.0], [0.2, 1.3, 2.0], [0.5, -1.1, -1.0], [2.5, 0.6, 0.4]])
REST, TURN, RATE = 6.0, 1.0, 50.0


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """An arm that rests in six poses; its joints come in two messages, in another order, next to those of a gripper."""
    path, chain, random = tmp_path_factory.mktemp("mount") / "bag", Chain(URDF, "soft_base", "world"), np.random.default_rng(2)
    imu = Rotation.from_euler("xyz", MOUNT)
    with TopicBag(path) as written:
        written.text("/robot_description", 100.0, URDF)
        for k in range(round(len(POSES) * (REST + TURN) * RATE)):
            time = k / RATE
            index, since = divmod(time, REST + TURN)
            here, there = POSES[int(index)], POSES[min(int(index) + 1, len(POSES) - 1)]
            share = max(0.0, (since - REST) / TURN)
            joints = here + share * (there - here)
            base = Rotation.from_matrix(chain.pose(dict(zip(chain.moving, joints)))[:3, :3])
            noise = 0.02 if share == 0.0 else 1.0
            force = (imu.inv() * base.inv()).apply([0.0, 0.0, STANDARD_GRAVITY]) + noise * random.standard_normal(3)
            rate = (0.002 if share == 0.0 else 1.0) * random.standard_normal(3)
            written.imu("/imu/data_raw", 100.0 + time, rate, force)
            written.joints("/joint_states", 100.0 + time, ["gripper", "left_j3", "left_j1"], [0.7, joints[2], joints[0]])
            written.joints("/joint_states", 100.0 + time, ["left_j2"], [joints[1]])
    return str(path)


def test_the_mount_is_found_and_written(bag, tmp_path, capsys):
    target = tmp_path / "mounted.yaml"
    assert main(["calibrate-mount", bag, "--write", str(target), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert figures["poses"] == len(POSES)
    found = load_robot_file(target).robot.imu_mount.rotation
    error = Rotation.from_matrix(found @ Rotation.from_euler("xyz", MOUNT).as_matrix().T).as_rotvec(degrees=True)
    assert np.abs(error).max() < 0.2
    assert (np.abs(error) <= 3.0 * np.array(figures["interval_deg"])).all()
    assert max(figures["interval_deg"]) < 0.5


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (("left_j1", "right_j1"), "has no positions of the joints right_j1; its joint states have: gripper, left_j1, left_j2"),
        (("soft_base", "flange"), "has no link 'soft_base'"),
    ],
)
def test_an_arm_that_does_not_fit_the_bag_is_refused(bag, tmp_path, capsys, changed, words):
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(URDF.replace(*changed), encoding="utf-8")
    assert main(["calibrate-mount", bag, "--urdf", str(urdf)]) == 2
    assert words in capsys.readouterr().err
