"""The target of a robot's shape at rest: what its cables keep, of a robot that is bent at rest as well."""

import numpy as np
import pytest

from gravcomp.calibration.course import predict_course
from gravcomp.calibration.held_pose import held_at_rest
from gravcomp.calibration.measured import Measured
from gravcomp.description import Cable, Elements, Limits, Material, RestShape, Robot, Segment
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.holdability.search import HoldSearch
from gravcomp.inverse import InverseOptions, bend_target, rest_target
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.simulation import Simulator
from gravcomp.trials import turning_base

BEND, PLANE = np.radians(70.0), np.radians(40.0)
MATERIAL = Material("neo_hookean", 2e6, 0.45)


def robot(*bends):
    """A tube of as many segments of 50 mm, each bent at rest by its angle in rad in the plane at 40 deg."""
    segments = tuple(
        Segment(f"s{i}", 0.05, 7e-3, 3e-3, material=MATERIAL, rest=RestShape(angle, PLANE) if angle else None)
        for i, angle in enumerate(bends)
    )
    cables = tuple(
        Cable(f"c{k}", np.radians(angle), 2.5e-3, segment=segments[-1].name) for k, angle in enumerate((40.0, 160.0, 280.0))
    )
    return Robot("hook", segments=segments, cables=cables, elements=Elements(around=4, along=8), limits=Limits(tension_max=8.0))


def same(one, other):
    for name in ("tip_position", "tip_direction", "backbone_position", "backbone_weight", "backbone_station"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), abs=1e-12), name


def test_that_of_a_straight_robot_is_straight_or_an_arc():
    weights = {"tip_direction_weight": 1e-3, "backbone_station": [0.3], "backbone_weight": [0.5]}
    same(rest_target(robot(0.0), **weights), bend_target(0.05, 0.0, 0.0, **weights))
    same(rest_target(robot(0.0, 0.0), 0.4, 1.0, **weights), bend_target(0.1, 0.4, 1.0, **weights))


def test_that_of_a_bent_robot_is_where_its_mesh_rests():
    hook = robot(0.0, BEND)
    target, model = rest_target(hook, backbone_station=[0.8], backbone_weight=[1.0]), RobotModel(hook)
    sections = model.effectors.sections(model.mesh.nodes)
    assert target.tip_position == pytest.approx(sections[-1, 0], abs=1e-6 * hook.length)
    axis = np.cross(sections[-1, 1], sections[-1, 2])
    # The tip's elements are chords of the arc.
    assert target.tip_direction == pytest.approx(axis / np.linalg.norm(axis), abs=0.02)
    assert np.hypot(*target.tip_position[:2]) > 0.02
    same(target, rest_target(hook, 0.0, 1.0, backbone_station=[0.8], backbone_weight=[1.0]))
    position, direction = rest_tip(hook)
    assert target.tip_position == pytest.approx(position) and target.tip_direction == pytest.approx(direction)


def test_a_bend_adds_to_that_at_rest():
    same(rest_target(robot(BEND), -BEND, PLANE, backbone_station=[0.4], backbone_weight=[1.0]),
         bend_target(0.05, 0.0, 0.0, backbone_station=[0.4], backbone_weight=[1.0]))  # fmt: skip
    same(rest_target(robot(0.3, 0.3), 0.2, PLANE), bend_target(0.1, 0.8, PLANE))
    across = rest_target(robot(0.3), 0.4, PLANE + np.pi / 2)
    same(across, bend_target(0.05, 0.5, PLANE + np.arctan2(0.4, 0.3)))


def test_a_bent_robot_without_weight_is_held_by_nothing():
    search = HoldSearch(RobotModel(robot(0.0, BEND)))
    tension, lateral = search.linear.tension(np.zeros(3))
    assert tension.max() < 1e-3 * search.robot.limits.tension_max and lateral < 1e-6 * search.robot.length


def test_a_planned_pose_holds_a_bent_robot_in_its_shape_at_rest():
    hook = robot(0.0, BEND)
    shape = held_at_rest(Simulator(hook, reduced=False), hook, None, InverseOptions(), np.array([0.0, 0.0, -1.0]))
    assert np.linalg.norm(shape.tip_position - rest_tip(hook)[0]) < 0.02 * hook.length


def test_a_bent_robot_falls_from_its_shape_at_rest():
    hook, gravity = robot(0.0, BEND), np.array([-9.81, 0.0, 0.0])
    tip, direction = rest_tip(hook)
    time = np.array([0.0, 1e-3])
    fall = Measured("here", np.zeros(2, int), time, np.tile(gravity, (2, 1)), np.full((2, 3), np.nan), np.tile(tip, (2, 1)))
    tips, directions = predict_course(hook, fall)
    assert tips[0] == pytest.approx(tip) and directions[0] == pytest.approx(direction)
    way = tips[1] - tip
    assert way[0] < 0.0 and np.linalg.norm(way) < 9.81 * time[1] ** 2  # it has just been let go


def test_lateral_residuals_are_counted_from_the_shape_at_rest():
    for each in (robot(0.0), robot(0.0, BEND)):
        target = rest_target(each)
        across = np.cross(target.tip_direction, [1.0, 0.0, 0.0])
        tips = target.tip_position + np.outer([0.0, 1e-3, 0.0], across) + np.outer([0.0, 0.0, -2e-3], target.tip_direction)
        assert turning_base._lateral(tips, target) == pytest.approx([0.0, 1e-3 * np.linalg.norm(across), 0.0], abs=1e-12)
