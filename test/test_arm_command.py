"""`./gravcomp arm`: the arm turns the base of the robot through five poses, and the robot keeps its shape."""

import pytest
from documents import documented

QUICK = ("--travel", "2")  # errors are measured at rest, after the motion


@pytest.mark.graph
@pytest.mark.timeout(1300)
def test_on_an_arm_the_tip_error_is_five_times_smaller_with_compensation(measured):
    answer = measured(*documented("./gravcomp arm --viewer")[1:], "--hold", "1.5", *QUICK, "--json", timeout=600)
    assert answer.code == 0, answer.err
    figures = answer.json
    assert figures["inclination_deg"] == [135.0, 90.0, 45.0, 0.0, -45.0]
    assert figures["tip_error_released_rms_mm"] > 15.0 and figures["ratio"] >= 5.0
    # The mount is known and the URDF is right: what remains, at worst, is the filter's error and the time between two messages in
    # the fast motion, which a slow machine makes longer. A wrong axis is 45 deg or more off in these poses.
    assert figures["arm_and_imu_disagree_by_deg"] < 22.5


@pytest.mark.graph
@pytest.mark.timeout(1300)
def test_gravity_from_the_arm_only_works_as_well(measured):
    # No filter has to follow the motion: it may be twice as fast.
    line = documented("./gravcomp arm --gravity arm --hold 3 --json")[1:]
    answer = measured(*line, "--hold", "1.5", "--travel", "1", timeout=600)
    assert answer.code == 0, answer.err
    assert answer.json["ratio"] >= 5.0


def test_an_arm_with_other_axes_is_refused_in_words(gravcomp, tmp_path):
    xacro = tmp_path / "two.urdf.xacro"
    xacro.write_text(
        '<robot name="two"><link name="world"/><link name="soft_tip"/>'
        '<joint name="arm" type="fixed"><parent link="world"/><child link="soft_tip"/></joint></robot>',
        encoding="utf-8",
    )
    answer = gravcomp("arm", "--xacro", str(xacro))
    assert answer.code == 2 and "has no link 'soft_base'; it has: world, soft_tip" in answer.err
