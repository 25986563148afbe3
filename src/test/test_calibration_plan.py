"""Planned calibrations: what is chosen, the table on paper, the session on a running robot, and how intervals cover the truth."""

import dataclasses
import errno
import os
import re

import numpy as np
import pytest

from gravcomp.calibration import planning, pose_candidates
from gravcomp.calibration.approach import APPROACH, approached, as_pulled
from gravcomp.calibration.files import read_measured
from gravcomp.calibration.force_length import length_rows
from gravcomp.calibration.live import LiveSession, Phase
from gravcomp.calibration.measured import MeasurementError, still_windows
from gravcomp.calibration.plan import Plan, PlannedPose, PlanOptions, gravity_of
from gravcomp.calibration.plan_file import load_plan, save_plan
from gravcomp.calibration.plan_table import is_plan_table, pulls, read_plan_table, write_plan_table
from gravcomp.calibration.planning import make_plan
from gravcomp.calibration.pose_candidates import ORIENTATIONS
from gravcomp.calibration.standstill import Standstill
from gravcomp.calibration.unknowns import Priors, Unknown
from gravcomp.closed_loop.setup import Setup
from gravcomp.config import ConfigError
from gravcomp.description import Cable, Elements, Limits, Material, Robot, Segment, load_robot_file
from gravcomp.inverse import InverseOptions
from gravcomp.mesh import MeshError
from gravcomp.mesh.body import body_mesh
from gravcomp.mesh.coarse import with_coarse_elements
from gravcomp.mesh.tube import coarse_elements
from gravcomp.trials.calibration_run import run_plan
from gravcomp.trials.coverage import RARE, counted, coverage

PERIOD = 0.3  # s
GRAVITY = np.array([0.0, 0.0, -9.81])


@pytest.fixture(scope="module")
def robot():
    segment = Segment("s", length=0.08, outer_diameter=0.01, lumen_diameter=0.004, material=Material(youngs_modulus=0.8e6))
    cables = tuple(Cable(f"c{i}", np.radians(120.0 * i), 3.5e-3, segment="s") for i in range(3))
    elements = Elements(around=6, along=4, radial=1)
    return Robot("short", segments=(segment,), cables=cables, elements=elements, limits=Limits(tension_max=2.0))


@pytest.fixture(scope="module")
def plan(robot):
    """A plan from half of the orientations, with small bends: the equilibria of neighbouring poses are near each other."""
    options = PlanOptions(budget=60.0, fewest=6, most=9, bend=np.radians(15.0))
    return make_plan(robot, PERIOD, options=options, orientations=ORIENTATIONS[::2])


def test_a_plan_keeps_to_its_time_and_to_the_limits(robot, plan):
    assert len(plan.poses) >= 6 and plan.duration <= 60.0 + 1e-9
    for pose in plan.poses:
        assert pose.displacement.max() <= robot.limits.displacement_max
        assert pose.displacement.min() >= robot.limits.displacement_min
        assert pose.tension.max() <= robot.limits.tension_max


@pytest.mark.parametrize(("largest_mm", "shown"), [(25.0, "+25.0 mm"), (0.0312, "+0.0312 mm")])
def test_pulls_of_small_robots_are_not_rounded_away(robot, tmp_path, largest_mm, shown):
    pose = PlannedPose(0.0, 0.0, np.array([1e-3 * largest_mm, np.nan, np.nan]), ("c0",), np.full(3, 0.1), np.zeros(3))
    assert shown in pulls(robot, pose)
    write_plan_table(Plan((pose,) * 3, (1.0,) * 3, 1.0, 1.0), robot, tmp_path / "plan.csv")
    text = (tmp_path / "plan.csv").read_text(encoding="utf-8").replace(",,,\n", ",0,0,80\n")
    (tmp_path / "plan.csv").write_text(text, encoding="utf-8")
    read = read_plan_table(tmp_path / "plan.csv", robot.cable_names)
    assert read.displacement[0, 0] == pytest.approx(1e-3 * largest_mm, rel=1e-3)


def test_every_cable_is_pulled_and_each_station_has_the_released_robot(robot, plan):
    assert {name for pose in plan.poses for name in pose.pulled} == set(robot.cable_names)
    for station in {pose.station for pose in plan.poses}:
        assert any(not pose.pulled for pose in plan.poses if pose.station == station)


@pytest.mark.slow
def test_a_plan_that_time_or_limits_forbid_is_refused(robot):
    """A turn that takes longer than all poses may; a robot that its cables hold, but that has no equilibrium without them."""
    orientations = ORIENTATIONS[:1]
    slow = PlanOptions(budget=10.0, rate=np.radians(1.0))
    with pytest.raises(ConfigError, match=r"robot 'short': no pose of \d+ s fits into 10 s; allow more time \(--time\)"):
        make_plan(robot, PERIOD, options=slow, orientations=orientations)
    # With one cable and few elements: each pull searches in vain for a second and more.
    payload = dataclasses.replace(robot.payload, mass=20.0)
    heavy = dataclasses.replace(robot, payload=payload, cables=robot.cables[:1], elements=Elements(around=4, along=2, radial=1))
    with pytest.raises(ConfigError, match=r"robot 'short': .*equilibrium.* no calibration can be planned"):
        make_plan(heavy, PERIOD, orientations=orientations)


def test_a_robot_whose_motors_wind_in_slowly_gets_fewer_poses_and_a_sentence(robot):
    """Cables that wind in 0.5 mm/s: released ones are less slack, and a brief plan takes the time that its poses need."""
    slow = dataclasses.replace(robot, limits=Limits(tension_max=2.0, displacement_rate=5e-4))
    options = PlanOptions(budget=60.0, fewest=9, most=12, bend=np.radians(15.0))
    fast_plan, slow_plan = (make_plan(one, PERIOD, options=options, orientations=ORIENTATIONS[:1]) for one in (robot, slow))
    assert fast_plan.note == "" and re.match(r"there is time for \d poses of [\d.]+ s only \(9 and more", slow_plan.note)
    assert 3 <= len(slow_plan.poses) < len(fast_plan.poses) and slow_plan.duration <= 60.0
    loosest = [min(pose.displacement.min() for pose in plan.poses) for plan in (fast_plan, slow_plan)]
    assert loosest[0] < loosest[1] < -planning.Priors().offset_share * robot.length  # its zero may be wrong by that
    tight = PlanOptions(budget=10.0, fewest=5, bend=np.radians(15.0))
    with pytest.raises(ConfigError, match="allow more time"):
        make_plan(slow, PERIOD, options=dataclasses.replace(tight, rate=np.radians(1.0)), orientations=ORIENTATIONS[:1])
    assured = make_plan(slow, PERIOD, options=dataclasses.replace(tight, assured=4), orientations=ORIENTATIONS[:1])
    assert len(assured.poses) >= 4 and assured.duration > 10.0


@pytest.mark.parametrize("limits", [{"displacement_min": -1e-6, "displacement_max": 1e-6}, {"tension_max": 2e-4}])
def test_a_plan_whose_pulls_nobody_can_see_is_refused(robot, limits):
    weak = dataclasses.replace(robot, limits=Limits(**{"tension_max": 2.0, **limits}))
    with pytest.raises(
        ConfigError, match=r"displacement_max_mm: .* by more than [\d.e-]+ mm.* uncertain by 0\.16 mm and 0\.5 deg"
    ):
        make_plan(weak, PERIOD, orientations=ORIENTATIONS[:1])


def test_cables_with_a_short_stroke_are_pulled_as_far_as_it_allows(robot):
    short = dataclasses.replace(robot, limits=Limits(tension_max=2.0, displacement_max=1e-6))
    poses = make_plan(short, PERIOD, orientations=ORIENTATIONS[:1]).poses
    moved = [np.linalg.norm(pose.tip - poses[0].tip) for pose in poses if pose.pulled]
    assert max(moved) > 1e-3 and max(pose.displacement.max() for pose in poses) <= 1e-6


def test_a_plan_is_read_as_it_was_saved(plan, tmp_path):
    save_plan(plan, tmp_path / "plan.json")
    read = load_plan(tmp_path / "plan.json")
    assert read.times == plan.times and [pose.pulled for pose in read.poses] == [pose.pulled for pose in plan.poses]
    np.testing.assert_array_equal(read.poses[1].displacement, plan.poses[1].displacement)


def test_a_filled_table_becomes_windows_at_rest(robot, plan, tmp_path):
    path = tmp_path / "plan.csv"
    write_plan_table(plan, robot, path)
    assert is_plan_table(path)
    with pytest.raises(MeasurementError, match="0 rows have a tip"):
        read_plan_table(path, robot.cable_names)
    lines = path.read_text(encoding="utf-8").splitlines()
    filled = [lines[0], *(line.removesuffix(",,,") + ",-10.5,0.2,79" if n < 4 else line for n, line in enumerate(lines[1:]))]
    path.write_text("\n".join(filled), encoding="utf-8")
    windows = read_plan_table(path, robot.cable_names)
    assert len(windows.gravity) == 4
    np.testing.assert_allclose(windows.tip_position[0], [-10.5e-3, 0.2e-3, 79e-3])
    np.testing.assert_allclose(windows.gravity[0], plan.poses[0].gravity, atol=1e-3)
    released = np.array([[name not in pose.pulled for name in robot.cable_names] for pose in plan.poses[:4]])
    np.testing.assert_array_equal(np.isnan(windows.displacement), released)
    with pytest.raises(MeasurementError, match="of another robot"):
        read_plan_table(path, ("other",))


def test_orientations_come_before_what_hardly_moves_the_tip_in_use():
    """Each orientation tells an error of its own of the tip in use; each pull a larger one of its cable alone."""
    poses, usual, rows = [], [], []
    for station in range(3):
        for cable in (None, 0, 1, 2):
            pulled = () if cable is None else (f"c{cable}",)
            poses.append(PlannedPose(0.0, float(station), np.zeros(3), pulled, np.zeros(3), np.zeros(3)))
            usual.append(cable is None)
            row = np.zeros((6, 7))
            row[0, station if cable is None else 3 + cable] = 2.0 if cable is None else 3.0
            rows.append(row)
    unknowns = [Unknown("modulus", (0,), 1.0) if k == 6 else Unknown("offset", (k,), 1.0) for k in range(7)]
    sought = planning._sought(np.array(rows), usual, unknowns)
    options = PlanOptions(budget=5 * 8.0)
    chosen = planning._chosen(poses, usual, np.array(rows), np.eye(7), sought, 7.0, options)
    assert {poses[k].station for k in chosen} == {(0.0, 0.0), (0.0, 1.0), (0.0, 2.0)}


def test_cables_are_pulled_no_faster_than_their_motors_follow():
    """Small capstans wind in slowly; where a cable runs over a motor at a third of its stroke, slower still."""
    file = load_robot_file("catheter")
    speed, hardware = file.hardware.drive.velocity_limit, file.hardware
    slow = dataclasses.replace(hardware, drive=dataclasses.replace(hardware.drive, velocity_limit=0.1 * speed))
    assert as_pulled(file.robot, slow).limits.displacement_rate == pytest.approx(0.09 * speed)
    motors = (dataclasses.replace(slow.motors[0], ratio=1.0 / 3.0), *slow.motors[1:])
    geared = dataclasses.replace(slow, motors=motors)
    assert as_pulled(file.robot, geared).limits.displacement_rate == pytest.approx(0.03 * speed)
    fast = dataclasses.replace(hardware, drive=dataclasses.replace(hardware.drive, velocity_limit=10.0))
    assert as_pulled(file.robot, fast).limits == file.robot.limits


def test_the_virtual_robot_rests_when_its_commands_do():
    """With capstans that wind in 2 mm/s; a rest that begins before the cables have arrived counts as a body that creeps."""
    setup = Setup.of(load_robot_file("article"), 1)
    hardware = dataclasses.replace(setup.hardware, drive=dataclasses.replace(setup.hardware.drive, velocity_limit=2e-3))
    setup = dataclasses.replace(setup, hardware=hardware)
    count = len(setup.robot.cables)
    pulled, tension = np.full(count, -1e-3), np.zeros(count)
    pulled[0], tension[0] = 3e-3, 0.5
    pose = PlannedPose(0.0, 0.0, pulled, (setup.robot.cable_names[0],), tension, np.zeros(3))
    measured = run_plan((setup, Plan((pose,), (2.8,), 0.5, 0.7)))
    began = int(np.flatnonzero(np.abs(measured.displacement - measured.displacement[-1]).max(axis=1) < 2e-5)[0])
    way = np.linalg.norm(measured.tip_position[began:] - measured.tip_position[-1], axis=1)
    assert 5 < began < len(way) + began - 4
    assert way[1:].max() < 0.1 * np.linalg.norm(measured.tip_position[0] - measured.tip_position[-1])


def session_plan() -> Plan:
    poses = tuple(
        PlannedPose(0.0, roll, np.array([pull, -2e-3, -2e-3]), ("c0",), np.zeros(3), np.zeros(3))
        for roll, pull in ((0.0, -2e-3), (0.0, 1e-3), (1.0, 1e-3))
    )
    return Plan(poses, (2.0, 2.0, 2.0), 1.5, 1.0)


def run(session: LiveSession, roll: float, start: float, duration: float) -> float:
    """Let `duration` s pass at 50 Hz with the base at a roll; return the time."""
    present = np.zeros(3)
    for step in range(round(duration / 0.02)):
        time = start + 0.02 * step
        session.on_gravity(time, gravity_of(0.0, roll))
        session.command(time, present)
        session.on_tip(time, np.array([0.0, 0.0, 0.08]), np.array([0.0, 0.0, 1.0]))
    return start + duration


def test_a_session_waits_for_the_base_and_goes_on_where_it_was(robot, tmp_path):
    out = tmp_path / "live.csv"
    session = LiveSession(robot, session_plan(), out)
    now = run(session, 2.0, 0.0, 3.0)
    assert session.phase == Phase.TURN and session.finished == 0 and "hold the base" in session.sentence()
    now = run(session, 0.05, now, 3.5)
    assert session.finished == 1 and session.phase in (Phase.PULL, Phase.REST)
    again = LiveSession(robot, session_plan(), out)  # after an interruption in the second pose
    assert again.finished == 1 and again.phase == Phase.TURN
    now = run(again, 0.0, now, 3.5)
    assert again.finished == 2 and again.phase == Phase.TURN
    run(again, 1.0, now, 3.5)
    assert again.phase == Phase.DONE
    measured = read_measured(out, robot.cable_names)
    assert set(measured.trial) == {0, 1}
    other = dataclasses.replace(robot, cables=robot.cables[:2])
    with pytest.raises(MeasurementError, match="not of this robot"):
        LiveSession(other, session_plan(), out)


def test_a_session_records_the_length_of_the_specific_force(robot, tmp_path):
    """Empty where the IMU gives none; a file without the column is continued without it."""
    out, plan = tmp_path / "live.csv", session_plan()
    session = LiveSession(robot, plan, out)
    now = run(session, 0.0, 0.0, 3.5)
    session.on_force(now, np.array([np.nan, 0.0, 9.9]))
    session.on_force(now, np.array([6.0, 0.0, 8.0]))
    run(session, 0.0, now, 3.5)
    measured = read_measured(out, robot.cable_names)
    length, told = measured.specific_force, (measured.time >= now) & (measured.time < now + 1.01)
    assert session.finished == 2 and told.sum() > 20 and length[told] == pytest.approx(10.0)
    assert np.isnan(length[~told]).all()  # before it came, and when the IMU has been silent for a second
    windows = still_windows(measured, Standstill.of(robot, 0.3))
    assert np.isnan(windows.specific_force[0]) and windows.specific_force[1] == pytest.approx(10.0)
    bias = [Unknown("bias", (axis,), 0.05) for axis in range(3)]
    assert len(length_rows(windows, bias, np.eye(3), Priors())[0]) == 1
    rows = [line.rsplit(",", 1)[0] for line in out.read_text(encoding="utf-8").splitlines()]
    out.write_text("\n".join(rows) + "\n", encoding="utf-8")
    earlier = LiveSession(robot, plan, out)
    run(earlier, 1.0, 20.0, 3.5)
    assert earlier.phase == Phase.DONE and read_measured(out, robot.cable_names).specific_force is None


def test_a_base_that_leaves_its_pose_begins_it_again(robot, tmp_path):
    session = LiveSession(robot, session_plan(), tmp_path / "live.csv")
    now = run(session, 0.0, 0.0, 1.5)
    assert session.phase in (Phase.PULL, Phase.REST)
    run(session, 1.0, now, 0.1)
    assert session.phase == Phase.TURN and not (tmp_path / "live.csv").exists()


def test_no_pose_is_lost_on_a_full_disk(robot, tmp_path, monkeypatch):
    out = tmp_path / "live.csv"
    session = LiveSession(robot, session_plan(), out)
    now = run(session, 0.0, 0.0, 3.5)
    assert session.finished == 1
    first, fsync = out.read_text(encoding="utf-8"), os.fsync
    monkeypatch.setattr(os, "fsync", full_disk)
    now = run(session, 1.0, run(session, 0.0, now, 3.5), 3.5)
    assert session.phase == Phase.DONE and not session.save()
    assert "No space left" in session.sentence() and "are kept" in session.sentence()
    assert out.read_text(encoding="utf-8") == first and [path.name for path in tmp_path.iterdir()] == ["live.csv"]
    monkeypatch.setattr(os, "fsync", fsync)
    assert session.save() and session.unwritten == "" and "all 3 poses" in session.sentence()
    assert out.read_text(encoding="utf-8").startswith(first) and LiveSession(robot, session_plan(), out).finished == 3


def full_disk(number):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize(
    ("late", "tip", "message"),
    [
        (-1.7e9, [0.0, 0.0, 0.08], "behind those of gravity .do they count from the start of a machine"),
        (0.0, [0.0, 0.0, 80.0], "a thousand times too large"),
        (0.0, [np.nan, 0.0, 0.08], "not finite numbers"),
        (0.0, [0.1, 0.1, 0.08], "another robot, or not in soft_base"),
        (0.0, None, "no measured tip arrives"),
    ],
)
def test_a_session_names_tips_that_cannot_be_of_the_robot(robot, tmp_path, late, tip, message):
    session = LiveSession(robot, session_plan(), tmp_path / "live.csv")
    for step in range(200):
        time = 1.7e9 + 0.02 * step
        session.on_gravity(time, gravity_of(0.0, 0.0))
        session.command(time, np.zeros(3))
        if tip is not None:
            session.on_tip(time + late, np.array(tip), np.array([0.0, 0.0, 1.0]))
    assert session.finished == 0 and session.phase == Phase.REST
    assert re.search(message, session.sentence())


def test_intervals_cover_the_truth_of_drawn_robots(robot, plan):
    """Of a few seeds; `bench robots --figures coverage_pct` takes 50 and three robots."""
    found = coverage(robot, plan, range(12))
    counted = sum(one.count for one in found.values())
    inside = sum(one.share * one.count for one in found.values())
    assert counted > 50 and inside / counted >= 0.9
    assert found["modulus"].share >= 0.9
    assert all(np.isfinite(one.width) and one.count >= 5 for one in found.values())


def test_kinds_that_few_seeds_tell_are_counted_together():
    """Of one interval neither a share nor a scatter follows."""
    errors = {"modulus": [0.1, -0.1] * 5, "friction": [0.3], "winding": [0.1, 0.1, 0.9]}
    halves = {"modulus": [0.2] * 10, "friction": [0.4], "winding": [0.2] * 3}
    found = counted(errors, halves, 10)
    assert set(found) == {"modulus", RARE} and found[RARE].count == 4 and found[RARE].share == 0.75
    assert found["modulus"].width == pytest.approx(2.0)
    assert set(counted(errors, halves, 50)) == set()


def test_a_pull_arrives_slower_and_slower_and_never_runs_past_its_goal(robot):
    """A motor that runs past its goal leaves a capstan inside the backlash of its gear."""
    goal, interval = np.array([3e-3, -2e-3, 1e-6]), 0.01
    here, moves = np.zeros(3), []
    for _ in range(round((APPROACH + 3e-3 / robot.limits.displacement_rate) / interval)):
        there = approached(goal, here, robot.limits, interval)
        moves.append(there - here)
        here = there
    np.testing.assert_array_equal(here, goal)
    steps = np.array(moves)
    assert (steps * np.sign(goal) >= 0.0).all() and np.abs(steps).max() <= robot.limits.displacement_rate * interval * (1 + 1e-9)
    left = np.abs(goal - np.cumsum(steps, axis=0))
    assert np.abs(steps[1:][left[:-1] < 1e-4]).max() < 0.1 * np.abs(steps).max()


def test_a_plan_holds_the_robot_straight_as_the_controller_does(robot):
    """At every station, after the released robot and before single cables: so every cable is wound in to where it pulls."""
    options = PlanOptions(budget=60.0, fewest=6, most=9, bend=np.radians(15.0))
    plan = make_plan(robot, PERIOD, options=options, orientations=ORIENTATIONS[:2], inverse=InverseOptions(pretension=0.02))
    for station in {pose.station for pose in plan.poses}:
        free, straight, *single = [pose for pose in plan.poses[:-1] if pose.station == station]
        assert not free.pulled and straight.pulled == robot.cable_names
        assert all(len(pose.pulled) == 1 for pose in single)
        assert np.linalg.norm(straight.tip[:2]) < 0.02 * np.linalg.norm(free.tip[:2])
        assert straight.tension.min() > 0.019
    winds_in = [
        (pose.displacement - before.displacement)[pose.tension > 0.0].min() > 0.0
        for before, pose in zip(plan.poses, plan.poses[1:])
        if pose.pulled
    ]
    assert all(winds_in)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pose_candidates, "held_at_rest", lambda simulator, *_: simulator.solve(GRAVITY, tension=np.full(3, 1.9)))
        tight = make_plan(robot, PERIOD, options=options, orientations=ORIENTATIONS[:1], inverse=InverseOptions())
    assert all(len(pose.pulled) <= 1 and pose.tension.max() <= 0.7 * robot.limits.tension_max for pose in tight.poses)


def test_a_robot_without_cables_has_a_plan(robot):
    bare = dataclasses.replace(robot, cables=())
    options = PlanOptions(budget=60.0, fewest=6, most=9)
    plan = make_plan(bare, PERIOD, options=options, orientations=ORIENTATIONS[:1], inverse=InverseOptions())
    assert len(plan.poses) >= 2 and not any(pose.pulled for pose in plan.poses)


def test_a_narrow_lumen_in_a_thick_wall_has_a_coarse_mesh(robot):
    """The first period, from which every plan begins, is that of a coarse mesh; the fewest elements would be refused here."""
    wall = dataclasses.replace(robot.segments[0], outer_diameter=0.020, lumen_diameter=0.002)
    narrow = dataclasses.replace(robot, segments=(wall,), elements=None)
    with pytest.raises(MeshError, match="Jacobian ratio"):
        body_mesh(dataclasses.replace(narrow, elements=coarse_elements(narrow)))
    body_mesh(with_coarse_elements(narrow))
