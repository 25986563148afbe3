"""Lines that cables are made of: what is described, and what stretches, in model, controller, virtual robot and calibration."""

import copy
import dataclasses
import math

import numpy as np
import pytest
import yaml

from gravcomp.calibration.apply import calibrated_robot, write_calibrated
from gravcomp.calibration.parameters import StaticParameters, cable_compliance
from gravcomp.canbus.codec import encode
from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.config import ConfigError
from gravcomp.description import Cable, CableLine, Elements, Material, Payload, Robot, Segment, load_robot_file, shipped_robots
from gravcomp.description.cable_line import CABLE_MATERIALS
from gravcomp.description.hardware import Hardware, Motor
from gravcomp.inverse import InverseController, straight_target
from gravcomp.reduction.reduced_cables import ReducedCables, stretch, tendons_at
from gravcomp.simulation import RobotModel, Simulator
from gravcomp.virtual.body import build_rod
from gravcomp.virtual.draw import draw
from gravcomp.virtual.motion import StaticMotion, base_orientation
from gravcomp.virtual.parameters import Tendons, VirtualRobotParameters
from gravcomp.virtual.robot import VirtualRobot

G = 9.81
NYLON = CableLine(material="nylon", diameter=0.7e-3, free_length=0.2)
STIFF = CableLine()
EA = 2.5e9 * math.pi * 0.35e-3**2


def article(line=STIFF, **changes):
    robot = load_robot_file("article").robot
    cables = tuple(dataclasses.replace(cable.without_line(), **changes) for cable in robot.cables)
    return dataclasses.replace(robot, elements=Elements(along=4), cables=cables, cable_defaults=line)


@pytest.fixture(scope="module")
def nylon():
    return Simulator(article(NYLON), reduced=False)


def load(folder, cable=None, defaults=None):
    """The article's robot with keys of its second cable and of the defaults for all."""
    document = copy.deepcopy(yaml.safe_load(shipped_robots()["article"].read_text(encoding="utf-8")))
    document["robot"].pop("cable_defaults", None)
    document["robot"]["cables"][1].update(cable or {})
    if defaults is not None:
        document["robot"]["cable_defaults"] = defaults
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return load_robot_file(path).robot


def test_a_cable_has_its_own_line_before_that_of_all(tmp_path):
    robot = load(
        tmp_path,
        {"axial_stiffness": 5000.0, "free_length_mm": 50.0},
        {"material": "nylon", "diameter_mm": 0.7, "free_length_mm": 200.0, "friction": 0.1},
    )
    first, second = robot.cables[:2]
    assert first.stiffness == pytest.approx(EA) and first.free_length == pytest.approx(0.2)
    assert second.stiffness == 5000.0 and second.free_length == pytest.approx(0.05) and second.friction == 0.1
    assert robot.cable_compliance(first) == pytest.approx(0.25 / EA)
    thinner = load(tmp_path, {"diameter_mm": 0.35}, {"material": "nylon", "diameter_mm": 0.7})
    assert thinner.cables[1].stiffness == pytest.approx(EA / 4)


def test_without_a_word_about_the_line_nothing_stretches(tmp_path):
    robot = load(tmp_path)
    assert not any(cable.stretches for cable in robot.cables)
    assert cable_compliance(robot) == pytest.approx(np.zeros(6))


@pytest.mark.parametrize(
    ("cable", "defaults", "complaint"),
    [
        ({"axial_stiffness": -960.0}, None, r"robot.cables\[1\].axial_stiffness is -960.0; allowed: 1 to 1e\+09 N"),
        ({"axial_stiffness": 0.0}, None, r"robot.cables\[1\].axial_stiffness is 0.0; allowed"),
        (
            {"material": "nilon", "diameter_mm": 0.7},
            None,
            "material is 'nilon'; allowed: one of steel_wire, .*nylon, dyneema, kevlar",
        ),
        ({"material": "nylon"}, None, r"cables\[1\] \('s1c2'\): material is given without diameter_mm"),
        ({"diameter_mm": 0.7}, None, "diameter_mm is given without material, one of steel_wire"),
        (
            {"material": "nylon", "diameter_mm": 0.7, "axial_stiffness": 960.0},
            None,
            "axial_stiffness and material and diameter_mm are",
        ),
        ({"free_length_mm": -1.0}, None, r"robot.cables\[1\].free_length_mm is -1.0; allowed: 0 to 20000 mm"),
        ({"sheath_angle_deg": -90.0}, None, r"sheath_angle_deg is -90.0; allowed: 0 to 3600 deg"),
        ({"pretension": 5.0}, None, "pretension is 5 N; allowed: below limits.tension_max = 5 N"),
        ({}, {"material": "rubber"}, "robot.cable_defaults.material is 'rubber'; allowed: one of"),
        ({}, {"angle_deg": 3.0}, "unknown key 'robot.cable_defaults.angle_deg'"),
    ],
)
def test_lines_that_cannot_be_are_refused_with_file_and_key(tmp_path, cable, defaults, complaint):
    with pytest.raises(ConfigError, match=f"robot.yaml.*{complaint}"):
        load(tmp_path, cable, defaults)


def test_a_taut_cable_is_wound_in_by_its_stretch_from_capstan_to_end(nylon):
    tension = np.array([0.6, 0.0, 0.1, 0.4, 0.0, 0.2])
    shape = nylon.solve([-G, 0.0, 0.0], tension=tension)
    path = nylon.solver.state.tendons.displacement
    length = 0.2 + np.array([0.05] * 3 + [0.1] * 3)
    assert shape.cable_displacement - path == pytest.approx(tension * length / EA, rel=1e-6, abs=1e-12)
    wound = np.where(tension > 0.0, shape.cable_displacement, shape.cable_displacement - 1e-3)
    again = nylon.solve([-G, 0.0, 0.0], displacement=wound)
    assert again.cable_tension == pytest.approx(tension, abs=1e-5)


def test_a_slack_cable_has_no_stretch(nylon):
    stiff = Simulator(article(), reduced=False)
    # Released, or wound in by less than the path: the same shape and the same displacements as with stiff cables.
    for displacement in (None, np.full(6, -5e-3)):
        one, other = (simulator.solve([-G, 0.0, 0.0], displacement=displacement) for simulator in (nylon, stiff))
        assert not one.cable_tension.any()
        assert one.tip_position == pytest.approx(other.tip_position, abs=1e-9)
        assert one.cable_displacement == pytest.approx(other.cable_displacement, abs=1e-9)


def test_the_command_has_the_stretch_of_taut_cables_only(nylon):
    controller, target, gravity = InverseController(nylon.robot), straight_target(nylon.robot.length), np.array([-G, 0.0, 0.0])
    shape = nylon.solve(gravity)
    for _ in range(60):
        command = controller.step(
            shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension, interval=0.1
        )
        shape = nylon.step(gravity, command.displacement)
    assert np.linalg.norm(shape.tip_position[:2]) < 0.1e-3
    beyond = command.displacement - nylon.solver.state.tendons.displacement
    taut = command.tension > 0.05
    assert taut.any() and not taut.all()
    stretched = command.tension * (0.2 + np.array([0.05] * 3 + [0.1] * 3)) / EA
    assert beyond[taut] == pytest.approx(stretched[taut], abs=2e-6)
    idle = command.tension < 1e-4
    assert idle.any() and (beyond[idle] <= 1e-7).all()


def test_friction_shortens_the_stretch_by_the_mean_of_the_tension():
    model = RobotModel(article(dataclasses.replace(NYLON, friction=0.2, sheath_angle=math.radians(180.0))))
    x = model.mesh.nodes.copy()
    z = x[:, 2] / model.length
    x += np.column_stack([0.02 * z**2, 0.005 * z**2, -0.003 * z])
    for pulling in (1.0, -1.0):
        state = model.tendons.state(x, np.full(6, pulling))
        own = np.flatnonzero(model.tendons._cable == 3)
        # At the entry the sheath has taken its share; a fine sum over sheath and pieces is the mean.
        assert state.share[own[0]] == pytest.approx(math.exp(-0.2 * pulling * math.pi))
        s = (np.arange(20000) + 0.5) / 20000
        along = (0.2 * np.exp(-0.2 * pulling * math.pi * s)).mean() + (state.share * state.length)[own].sum()
        assert state.mean_share[3] == pytest.approx(along / (0.2 + state.length[own].sum()), rel=1e-6)
        assert model.tendons.stretch(state)[3] == pytest.approx(0.3 / EA * state.mean_share[3])


def test_the_reduced_cables_stretch_like_the_full_models():
    model = RobotModel(article(dataclasses.replace(NYLON, friction=0.2, sheath_angle=math.radians(90.0))))
    tendons, field = model.tendons, np.zeros((len(model.mesh.nodes), 3))
    field[:, 0] = (model.mesh.nodes[:, 2] / model.length) ** 2
    straight, bent = (tendons.state(model.mesh.nodes + a * field) for a in (0.0, 0.02))
    pieces = [np.ascontiguousarray((state.tangent * state.length[:, None]).T) for state in (straight, bent)]
    cables = ReducedCables(
        rest=pieces[0],
        change=((pieces[1] - pieces[0]) / 0.02)[None],
        cable=tendons._cable,
        first=np.searchsorted(tendons._cable, np.arange(7)),
        rest_length=tendons.rest_length,
        axial_compliance=tendons.axial_compliance,
        friction=tendons.friction.coefficient,
        sheath_angle=tendons.friction.sheath_angle,
        free_length=tendons.friction.free_length,
    )
    for pulling in (np.zeros(6), np.array([1.0, -1.0, 0.0, 1.0, -1.0, 1.0])):
        full = tendons.state(model.mesh.nodes + 0.02 * field, pulling)
        reduced = tendons_at(cables, np.array([0.02]), pulling)
        assert reduced.share == pytest.approx(full.share, rel=1e-9)
        assert stretch(cables, reduced) == pytest.approx(tendons.stretch(full), rel=1e-9)


def test_a_cables_own_pretension_is_kept():
    robot = article(NYLON)
    kept = dataclasses.replace(
        robot, cables=(dataclasses.replace(robot.cables[1], name="kept", pretension=0.3), *robot.cables[:1], *robot.cables[2:])
    )
    simulator, controller = Simulator(kept, reduced=False), InverseController(kept)
    shape, target = simulator.solve([-G, 0.0, 0.0]), straight_target(robot.length)
    for _ in range(40):
        command = controller.step(
            shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension, interval=0.1
        )
        shape = simulator.step([-G, 0.0, 0.0], command.displacement)
    assert shape.cable_tension[0] == pytest.approx(0.3, abs=0.02)
    assert shape.cable_tension[1:].min() == 0.0


def true_article(robot, **tendons):
    file = load_robot_file("article")
    hardware = file.hardware
    return draw(VirtualRobotParameters(tendons=dataclasses.replace(Tendons(), **tendons)), robot, hardware, seed=1)


def test_the_virtual_robot_has_the_described_line():
    true = true_article(article(dataclasses.replace(NYLON, friction=0.3, sheath_angle=1.0)))
    lines = true.cables
    assert lines.axial_stiffness == pytest.approx([EA] * 6, rel=0.1) and lines.free_length == pytest.approx([0.2] * 6)
    assert lines.friction == pytest.approx([0.3] * 6, rel=0.2) and lines.guide_angle == pytest.approx([1.0] * 6)
    given = true_article(article(NYLON), axial_stiffness=800.0)
    assert given.cables.axial_stiffness == pytest.approx([800.0] * 6)
    rod = build_rod(given)
    assert rod.tendon_stiffness == pytest.approx(800.0 / (0.2 + np.array([0.05] * 3 + [0.1] * 3)))


def test_a_line_that_nobody_describes_is_stiff_in_the_virtual_robot():
    robot = article()
    true = true_article(robot)
    stretch = robot.limits.tension_max / true.cables.axial_stiffness
    assert stretch.min() >= 1e-3 and stretch.max() <= 3e-3
    assert true.cables.free_length == pytest.approx([2.0 * robot.length] * 6, rel=0.1)


def test_the_loop_assumes_the_most_probable_line_where_none_is_described():
    """Lines of 20 seeds scatter around the one in the model. What is described stays, and so does the described robot."""
    robot = article()
    hardware = load_robot_file("article").hardware
    drawn = [draw(VirtualRobotParameters(), robot, hardware, seed).cables for seed in range(20)]
    inside = np.array([robot.line_length(cable) for cable in robot.cables])
    true = np.array([(lines.free_length + inside) / lines.axial_stiffness for lines in drawn])
    assumed = robot.with_assumed_lines()
    found = np.array([assumed.cable_compliance(cable) for cable in assumed.cables])
    assert (true.min(axis=0) < found).all() and (found < true.max(axis=0)).all()
    assert true.mean(axis=0) == pytest.approx(found, rel=0.15)
    described = article(NYLON)
    assert described.with_assumed_lines() is described
    half = article(dataclasses.replace(NYLON, free_length=None)).with_assumed_lines()
    assert half.cables[0].stiffness == pytest.approx(EA) and half.cables[0].free_length == pytest.approx(2.0 * half.length)


def test_stiff_lines_do_not_slow_the_virtual_robot_down():
    """Motors pull the robot up with lines of 5 and of 200 kN; the tips move alike, and every step is solved."""
    file = load_robot_file("article")
    hardware = file.hardware
    tips = []
    for stiffness in (5e3, 2e5):
        parameters = VirtualRobotParameters(tendons=dataclasses.replace(Tendons(), axial_stiffness=stiffness, slack=2e-3))
        virtual = VirtualRobot(parameters, article(), hardware, seed=1, motion=StaticMotion(base_orientation(0.0)))
        upper = [  # the cables of the upper side
            encode("MotorCommand1to4", current_1=0.2, current_2=0.0, current_3=0.0, current_4=0.2),
            encode("MotorCommand5to8", current_5=0.0, current_6=0.2, current_7=0.0, current_8=0.0),
        ]
        tips.append([(virtual.step(0.02, upper), virtual.truth.tip_position)[1] for _ in range(60)])
        assert virtual.unresolved == 0
    moved = np.ptp(np.array(tips[0])[:, 0])
    assert moved > 0.05
    assert np.abs(np.array(tips[0]) - np.array(tips[1])).max() < 0.05 * moved


def held(model, virtual):
    """Return the lateral residual in m of a robot with one description in the model and another one in the virtual robot."""
    setup = Setup.of(load_robot_file("article"))
    truth = dataclasses.replace(
        setup.truth,
        body=dataclasses.replace(setup.truth.body, youngs_modulus=2.9e6),
        tendons=dataclasses.replace(Tendons(), radius_offset=0.0, angle_offset=0.0),
        motors=dataclasses.replace(setup.truth.motors, backlash=0.0),  # it moves the tip as much as what the lines leave
    )
    motors = tuple(Motor(cable.name, i + 1) for i, cable in enumerate(model.cables))
    setup = dataclasses.replace(setup, robot=model, nominal=virtual, truth=truth, hardware=Hardware(motors=motors))
    loop = ClosedLoop(setup, StaticMotion(base_orientation(0.0)), heating=False)
    loop.hold(straight_target(model.length))
    loop.run(3.0)
    return np.linalg.norm(loop.trace.between(loop.time - 0.3).tip_position[:, :2], axis=1).mean()


@pytest.mark.slow
def test_the_loop_holds_a_stiff_robot_on_soft_lines_if_they_are_described():
    """Stiffness and load are such that the lines stretch by four times the displacement that straightens the robot."""
    segment = Segment("s", 0.1, 9e-3, 3e-3, material=Material(youngs_modulus=3e6, poissons_ratio=0.45, density=1145.0))
    cables = tuple(Cable(f"c{i}", math.radians(120 * i), 3e-3, segment="s") for i in range(3))
    silent = Robot("stiff", segments=(segment,), cables=cables, elements=Elements(along=6), payload=Payload(5e-3))
    described = dataclasses.replace(silent, cable_defaults=CableLine(material="nylon", diameter=0.3e-3, free_length=0.2))
    before, after = held(silent, described), held(described, described)
    assert before > 5e-3
    assert after < 0.15 * before


def test_a_calibration_replaces_the_described_line(tmp_path):
    path, target = tmp_path / "robot.yaml", tmp_path / "mine.yaml"
    robot = load(
        tmp_path, {"material": "kevlar", "diameter_mm": 0.3}, {"material": "nylon", "diameter_mm": 0.7, "free_length_mm": 200}
    )
    compliance = np.array([0.3e-3, 0.3e-3, 0.3e-3, 0.0, 0.4e-3, 0.4e-3])
    fitted = calibrated_robot(robot, StaticParameters(0.8e6, np.zeros(6), compliance))
    write_calibrated(path, target, robot, fitted, None)
    mine = load_robot_file(target).robot
    assert cable_compliance(mine) == pytest.approx(compliance, abs=1e-6)
    assert mine.cables[0].free_length == pytest.approx(0.2)


def test_every_material_is_known_by_its_modulus():
    for name, modulus in CABLE_MATERIALS.items():
        line = CableLine(material=name, diameter=1e-3)
        assert line.stiffness == pytest.approx(modulus * math.pi / 4 * 1e-6)
