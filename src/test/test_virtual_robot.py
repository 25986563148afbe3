"""The virtual robot behind its CAN frames: rates, repeatability, faults."""

import dataclasses

import numpy as np
import pytest
from virtual_article import article, virtual_robot, with_body

from gravcomp.canbus.codec import decode, encode
from gravcomp.canbus.imu_scales import gyroscope_scale
from gravcomp.config import ConfigError, from_mapping
from gravcomp.description.robot_file import load_robot_file
from gravcomp.virtual.faults import KINDS, Fault
from gravcomp.virtual.motion import RotationMotion, TremorMotion, base_orientation, tilting
from gravcomp.virtual.parameters import Board, Tendons, VirtualRobotParameters
from gravcomp.virtual.robot import VirtualRobot


def names(frames):
    return [decode(frame).name for frame in frames]


def currents(*values):
    low = {f"current_{i + 1}": values[i] if i < len(values) else 0.0 for i in range(4)}
    high = {f"current_{i + 5}": values[i + 4] if i + 4 < len(values) else 0.0 for i in range(4)}
    return [encode("MotorCommand1to4", **low), encode("MotorCommand5to8", **high)]


def test_frames_come_at_their_rates_in_the_order_of_time():
    frames = virtual_robot().step(1.0)
    count = {name: names(frames).count(name) for name in set(names(frames))}
    assert count == {
        **{f"MotorFeedback{i}": 500 for i in range(1, 7)},
        "ImuAccelerometer": 100,
        "ImuGyroscope": 100,
        "ImuTime": 100,
        "BoardStatus": 10,
    }
    stamps = [frame.timestamp for frame in frames]
    assert stamps == sorted(stamps) and stamps[-1] == pytest.approx(1.0)


def test_steps_of_any_length_give_the_same_run():
    whole, pieces = virtual_robot(), virtual_robot()
    frames = whole.step(0.1)
    collected = [frame for dt in (0.0137, 0.0003, 0.036, 0.05) for frame in pieces.step(dt)]
    assert [(f.arbitration_id, bytes(f.data)) for f in frames] == [(f.arbitration_id, bytes(f.data)) for f in collected]


def run_with_faults(seed):
    robot = virtual_robot(seed=seed, motion=TremorMotion(base_orientation(0.3), seed))
    sent = []
    for k in range(100):
        if k == 20:
            robot.inject(Fault("drop", probability=0.3, duration=0.2))
            robot.inject(Fault("corrupt", frames="imu", probability=0.5))
        sent += [(f.arbitration_id, bytes(f.data)) for f in robot.step(0.004, currents(0.3 if k < 50 else -0.3, 0.2))]
    return sent, robot.truth.tip_position


def test_the_same_seed_gives_the_same_run_and_another_seed_another():
    (first, tip), (second, same_tip), (other, _) = run_with_faults(3), run_with_faults(3), run_with_faults(4)
    assert first == second
    np.testing.assert_array_equal(tip, same_tip)
    assert first != other


def test_released_it_sags_and_a_current_pulls_it_up():
    parameters = VirtualRobotParameters(tendons=dataclasses.replace(Tendons(), slack=8e-3))
    robot = virtual_robot(parameters)
    robot.step(0.2)
    sag = robot.truth.tip_position[0]
    assert sag < -0.025
    # Cable s1c1 at 0 deg and s2c1 at 60 deg lie on the upper side; s2c3 at 300 deg balances s2c1.
    for _ in range(400):
        robot.step(0.005, currents(0.2, 0.0, 0.0, 0.2, 0.0, 0.2))
    assert robot.truth.tip_position[0] > sag + 0.01
    assert robot.truth.tension[[0, 3, 5]].min() > 0.05 and (robot.truth.tension[[1, 2, 4]] == 0.0).all()


def test_truth_is_consistent():
    robot = virtual_robot()
    robot.step(0.5)
    truth = robot.truth
    np.testing.assert_allclose(truth.backbone_position[-1], truth.tip_position, atol=1e-12)
    np.testing.assert_allclose(truth.backbone_position[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(truth.backbone_orientation[-1], truth.tip_orientation, atol=1e-9)
    np.testing.assert_allclose(truth.gravity, [-9.80665, 0.0, 0.0], atol=1e-9)
    lengths = np.linalg.norm(np.diff(truth.backbone_position, axis=0), axis=1)
    np.testing.assert_allclose(lengths, 0.01, rtol=0.02)


def test_the_imu_of_a_base_at_rest_measures_gravity_upward():
    still = dataclasses.replace(
        Board(), accelerometer_noise=0.0, accelerometer_bias=0.0, accelerometer_scale=0.0, accelerometer_drift=0.0
    )
    robot = virtual_robot(VirtualRobotParameters(board=still))
    sample = [decode(f).values for f in robot.step(0.05) if decode(f).name == "ImuAccelerometer"][-1]
    description, _ = article()
    up = description.imu_mount.rotation.T @ [5460.0, 0.0, 0.0]
    np.testing.assert_allclose(sample[:3], up, atol=1.0)


def test_a_base_that_is_steered_starts_from_its_last_pose():
    robot = virtual_robot(motion=tilting(hold=0.0, rate=1.0))
    robot.step(0.5)
    wanted, gravity = base_orientation(-0.5), [robot.truth.gravity]
    robot.turn_base(wanted)
    for _ in range(300):
        robot.step(0.01)
        gravity.append(robot.truth.gravity)
    # 9.81 m/s^2 turned at the limit of 360 deg/s for 10 ms, and no jump.
    assert np.linalg.norm(np.diff(gravity, axis=0), axis=1).max() < 1.05 * 9.81 * np.radians(3.6)
    np.testing.assert_allclose(gravity[-1], wanted.T @ [0.0, 0.0, -9.81], atol=0.01)


def test_skipped_time_loses_samples_and_nothing_else():
    """Rate times the time of the board is the rotation of the base, the skipped time included; the rod keeps its shape."""
    rate = np.radians(60.0)
    still = dataclasses.replace(Board(), gyroscope_noise=0.0, gyroscope_bias=0.0, gyroscope_drift=0.0, mount_error=0.0)
    motion = RotationMotion(base_orientation(0.0), np.array([0.0, 1.0, 0.0]), rate, hold=0.0)
    robot = virtual_robot(VirtualRobotParameters(board=still), motion=motion)
    before = [decode(frame) for frame in robot.step(0.2)]
    tip = robot.truth.tip_position
    assert robot.skip(0.117) == pytest.approx(0.11)
    assert robot.time == pytest.approx(0.31)
    np.testing.assert_allclose(robot.truth.tip_position, tip, atol=1e-9)
    np.testing.assert_allclose(robot.truth.gravity, motion.pose(0.31)[0].T @ [0.0, 0.0, -9.80665], atol=1e-9)
    after = [decode(frame) for frame in robot.step(0.05)]
    first, last = ([f.values for f in frames if f.name == "ImuTime"][k] for frames, k in ((after, 0), (before, -1)))
    assert first.sequence - last.sequence == 12
    assert first.time - last.time == pytest.approx(120_000, rel=1e-3)
    gyro = next(f.values for f in after if f.name == "ImuGyroscope")
    assert np.linalg.norm(gyro[:3]) * gyroscope_scale(still.gyroscope_range) == pytest.approx(rate, rel=0.01)
    assert robot.unresolved == 0


def test_a_steered_base_keeps_its_angular_velocity_in_skipped_time():
    robot = virtual_robot()
    wanted = base_orientation(0.0)
    for k in range(100):  # steered at 60 deg/s, every 10 ms
        wanted = base_orientation(np.radians(0.6 * k))
        robot.turn_base(wanted)
        robot.step(0.01)
    before = robot.truth.gravity
    robot.skip(0.1)
    after = robot.truth.gravity
    angle = np.degrees(np.arccos(before @ after / np.linalg.norm(before) / np.linalg.norm(after)))
    assert angle == pytest.approx(6.0, abs=0.3)


def test_every_kind_of_fault_can_be_injected_and_cleared():
    robot = virtual_robot()
    for kind in KINDS:
        robot.inject(Fault(kind, duration=0.02))
        robot.step(0.03, currents(0.1))
    assert robot.faults == ()
    for kind in KINDS:
        robot.inject(Fault(kind))
    robot.step(0.05)
    robot.clear_faults()
    robot.step(0.05)
    assert len(robot.step(0.1)) == len(virtual_robot().step(0.1))


def test_faults_of_frames_change_the_frames():
    def frames_with(fault, seconds=0.2):
        robot = virtual_robot()
        clean = virtual_robot().step(seconds)
        robot.inject(fault)
        return clean, robot.step(seconds)

    clean, dropped = frames_with(Fault("drop", frames="imu"))
    assert set(names(clean)) - set(names(dropped)) == {"ImuAccelerometer", "ImuGyroscope", "ImuTime"}
    clean, dropped = frames_with(Fault("drop", cable="s1c2"))
    assert set(names(clean)) - set(names(dropped)) == {"MotorFeedback2"}
    clean, late = frames_with(Fault("delay", frames="status", delay=0.05))
    assert names(clean).count("BoardStatus") == 2 and names(late).count("BoardStatus") == 1
    clean, twice = frames_with(Fault("duplicate", frames="status"))
    assert names(twice).count("BoardStatus") == 4
    clean, mixed = frames_with(Fault("reorder", frames="imu", probability=1.0))
    imu = [name for name in names(mixed) if name.startswith("Imu")]
    assert imu[:2] == ["ImuGyroscope", "ImuAccelerometer"]
    clean, renamed = frames_with(Fault("wrong_id", cable="s1c1"))
    assert names(renamed).count("MotorFeedback2") == 2 * names(clean).count("MotorFeedback2")
    clean, silent = frames_with(Fault("bus_off"))
    assert silent == []
    clean, corrupt = frames_with(Fault("corrupt", frames="feedback"))
    assert len(corrupt) == len(clean)
    assert sum(bytes(a.data) != bytes(b.data) for a, b in zip(clean, corrupt)) == sum("Feedback" in name for name in names(clean))


def test_a_faulty_bus_keeps_commands_from_the_motors():
    robot = virtual_robot()
    robot.step(0.01, currents(0.2))
    robot.inject(Fault("drop", frames="command"))
    robot.step(0.1, currents(0.0))
    assert robot.truth.current[0] == pytest.approx(0.2), "the speed controller keeps its last current"
    robot.clear_faults()
    robot.step(0.1, currents(0.0))
    assert robot.truth.current[0] == 0.0


def test_hostile_frames_are_counted_and_change_nothing():
    robot = virtual_robot()
    frame = encode("MotorCommand1to4", current_1=0.1, current_2=0.0, current_3=0.0, current_4=0.0)
    frame.data = frame.data[:3]
    frame.dlc = 3
    robot.step(0.01, [frame])
    assert robot.refused == 1 and (robot.truth.current == 0.0).all()


def test_unknown_faults_cables_and_motors_are_refused_with_the_allowed_ones():
    with pytest.raises(ConfigError, match="kind is 'explode'; allowed: one of drop"):
        Fault.parse({"kind": "explode"}, "virtual/fault")
    with pytest.raises(ConfigError, match=r"s9c9.*allowed: s1c1"):
        virtual_robot().inject(Fault("stall", cable="s9c9"))
    robot, hardware = article()
    with pytest.raises(ConfigError, match="motors for the cables s1c1"):
        VirtualRobot(VirtualRobotParameters(), robot, dataclasses.replace(hardware, motors=hardware.motors[:3]))


def test_the_shipped_section_differs_from_the_controllers_model():
    file = load_robot_file("article")
    parameters = from_mapping(VirtualRobotParameters, file.section("virtual_robot"), source=file.source, key="virtual_robot")
    assert parameters.body.youngs_modulus != file.robot.segments[0].material.youngs_modulus
    assert parameters.body.density != file.robot.segments[0].material.density


def test_creep_needs_a_ratio_for_every_time():
    with pytest.raises(ConfigError, match="creep_ratio has 1 entries and creep_time 2"):
        from_mapping(VirtualRobotParameters, {"body": {"creep_ratio": [0.1], "creep_time": [1.0, 2.0]}}, source="robot.yaml")
    assert with_body(creep_ratio=(), creep_time=()).body.creep_ratio == ()
