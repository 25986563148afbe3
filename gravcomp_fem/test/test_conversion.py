"""Shapes and targets survive their messages; invalid messages are refused."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from geometry_msgs.msg import Pose
from gravcomp_fem.conversion import contact_of, deformation_message, pose_target, response_of, shape_target
from std_msgs.msg import Header

from gravcomp.contact.contacts import Contacts
from gravcomp.inverse import TargetError
from gravcomp.simulation import Response
from gravcomp_msgs.msg import ShapeTarget


def test_the_response_survives_its_message_bit_for_bit(shape):
    message = deformation_message(shape, Header(frame_id="soft_base"))
    response = response_of(message)
    for field in dataclasses.fields(Response):
        assert np.array_equal(getattr(response, field.name), getattr(shape.response, field.name))
    assert (message.status, message.message, message.model) == (1, "beyond its range", "reduced")
    assert np.array_equal(np.reshape(message.backbone_position, (-1, 3)), shape.backbone_position)


def test_what_the_robot_touches_survives_its_message(shape):
    rng, cables = np.random.default_rng(2), len(shape.cable_tension)
    contacts = Contacts(
        obstacle=np.array([1, 0, 1]), station=np.array([0.4, 0.8, 1.0]), position=rng.normal(size=(3, 3)),
        normal=np.tile([1.0, 0.0, 0.0], (3, 1)), force=np.array([[0.2, 0.0, 0.1], [0.3, 0.0, 0.0], [0.5, 0.0, 0.0]]),
        gap=np.zeros(3), sliding=np.zeros(3, bool), by_tension=rng.normal(size=(3, cables)), names=("table", "ball", "table"),
    )  # fmt: skip
    message = deformation_message(dataclasses.replace(shape, contacts=contacts), Header())
    found = contact_of(message)
    assert found.names == ("ball", "table") and found.force == pytest.approx([0.3, 0.7])
    assert np.array_equal(found.position, contacts.position[1:])
    assert found.change == pytest.approx(np.stack([contacts.by_tension[1], contacts.by_tension[[0, 2]].sum(axis=0)]))
    assert not len(contact_of(deformation_message(shape, Header())))
    message.contact_force = [0.3]
    with pytest.raises(ValueError, match="contact_force has 1 numbers; 1 x 2 are needed"):
        contact_of(message)


@pytest.mark.parametrize("field", ["compliance_aa", "compliance_ea", "cable_displacement_free", "effector_free"])
def test_arrays_of_wrong_size_or_not_finite_are_refused(shape, field):
    message = deformation_message(shape, Header())
    setattr(message, field, list(getattr(message, field))[:-1])
    with pytest.raises(ValueError, match=field):
        response_of(message)
    message = deformation_message(shape, Header())
    broken = list(getattr(message, field))
    broken[0] = float("nan")
    setattr(message, field, broken)
    with pytest.raises(ValueError, match="not finite"):
        response_of(message)


def test_a_compliance_of_zero_is_refused(shape):
    message = deformation_message(shape, Header())
    message.compliance_aa = [0.0] * len(message.compliance_aa)
    with pytest.raises(ValueError, match="diagonal of compliance_aa"):
        response_of(message)


def test_a_bend_is_an_arc_of_the_robots_length():
    message = ShapeTarget(bend=True, bend_angle=np.pi / 2, bend_plane=0.0, tip_position_weight=1.0)
    target = shape_target(message, 0.1)
    radius = 0.1 / (np.pi / 2)
    assert target.tip_position == pytest.approx([radius, 0.0, radius])
    assert target.tip_direction == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)


def test_a_pose_points_along_its_z_axis():
    pose = Pose()
    pose.orientation.y = pose.orientation.w = np.sqrt(0.5)
    assert pose_target(pose, 1.0, 0.01).tip_direction == pytest.approx([1.0, 0.0, 0.0])
    pose.orientation.w = 5.0
    with pytest.raises(TargetError, match="unit quaternion"):
        pose_target(pose, 1.0, 0.01)


def test_a_target_without_any_weight_is_refused():
    with pytest.raises(TargetError, match="weight"):
        shape_target(ShapeTarget(), 0.1)


# In a process of its own: what other tests have compiled would hide what the warm-up leaves out.
COMPILED_IN_THE_LOOP = """
import sys
import numpy as np
from numba.core.dispatcher import Dispatcher
from std_msgs.msg import Header
from gravcomp.description import load_robot_file
from gravcomp.inverse import InverseController, bend_target, straight_target
from gravcomp.launcher.compilation import ITSELF, LOOP, SURROUNDED, run_part
from gravcomp.simulation import Simulator
from gravcomp_fem.conversion import contact_of, deformation_message, response_of

def signatures(package):
    modules = [module for name, module in list(sys.modules.items()) if name.startswith(package)]
    compiled = [(name, f) for module in modules for name, f in vars(module).items() if isinstance(f, Dispatcher)]
    return {(name, str(signature)) for name, f in compiled for signature in f.signatures}

robot = load_robot_file("article").robot
for part in LOOP:
    run_part(part)
simulator, controller, cables = Simulator(robot, reduced=False), InverseController(robot), None
before = signatures("gravcomp")
assert before
bend = bend_target(robot.length, 1, 0, tip_position_weight=1, backbone_station=[0.4], backbone_weight=[1])
targets = [straight_target(robot.length), bend]
for target in targets:
    for gravity in ([0.0, 0.0, 9.81], [-9.81, 0.0, 0.0]):
        message = deformation_message(simulator.step(np.array(gravity), cables, duration=0.01), Header())
        answer = response_of(message)
        cables = controller.step(
            answer, target, backbone_station=message.backbone_station, tension=message.cable_tension, interval=0.01).displacement
controller.relax(answer)
print(sorted(signatures("gravcomp") - before))

from gravcomp.config import from_mapping
from gravcomp.launcher.compilation import VIRTUAL
from gravcomp.virtual.parameters import VirtualRobotParameters
from gravcomp.virtual.robot import VirtualRobot

for part in VIRTUAL:
    run_part(part)
before, file = signatures("gravcomp.virtual"), load_robot_file("article")
virtual = VirtualRobot(from_mapping(VirtualRobotParameters, {}, source="defaults"), file.robot, file.hardware)
for _ in range(3):
    virtual.step(0.02)
    assert virtual.truth.time > 0.0
print(sorted(signatures("gravcomp.virtual") - before))

from gravcomp.scene import SceneSection, SphereWall
from gravcomp.scene.scene import Scene

for part in SURROUNDED:
    run_part(part)
before = signatures("gravcomp")
ball = SphereWall(name="ball", centre=(-0.03, 0.0, 0.07), radius=0.02, side="outside", friction=0.1)
scene = Scene(SceneSection(spheres=(ball,)))
simulator = Simulator(robot, reduced=False, scene=scene)
controller, cables = InverseController(robot, scene=scene), np.zeros(len(robot.cables))
for _ in range(3):
    shape = simulator.step(np.array([-9.81, 0.0, 0.0]), cables)
    cables = controller.step(
        shape.response, targets[0], backbone_station=shape.backbone_station, tension=shape.cable_tension, interval=0.01,
        contact=shape.contacts.by_obstacle(), gravity=np.array([-9.81, 0.0, 0.0])).displacement
assert len(shape.contacts), "the robot does not touch the ball"
print(sorted(signatures("gravcomp") - before))

from gravcomp.bench.contact_itself import GRAVITY, coarse, coiled_file

for part in ITSELF:
    run_part(part)
file = coarse(coiled_file())
before = signatures("gravcomp")
simulator = Simulator(file.robot, reduced=False, scene=file.scene)
for wound in [*np.arange(1.0, 14.0), 13.5, 14.0]:
    shape = simulator.step(GRAVITY, np.array([1e-3 * wound, np.nan, np.nan]))
assert len(shape.contacts), "the robot does not touch itself"
print(sorted(signatures("gravcomp") - before))
"""


def test_the_warm_up_compiles_everything_that_the_loop_runs():
    ended = subprocess.run([sys.executable, "-c", COMPILED_IN_THE_LOOP], capture_output=True, text=True)
    assert ended.stdout == "[]\n[]\n[]\n[]\n", ended.stdout + ended.stderr
