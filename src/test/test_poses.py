"""Poses measured by markers: hung weights, markers on and outside the body, tables with any columns, and fits to them."""

import dataclasses

import numpy as np
import pytest
import yaml

from gravcomp.calibration.apply import robot_of_poses
from gravcomp.calibration.chain import Chain
from gravcomp.calibration.mapping import Mapping, load_mapping
from gravcomp.calibration.markers import Markers
from gravcomp.calibration.measured import MeasurementError
from gravcomp.calibration.pose_fit import MODULUS, PosePriors, base_unknowns, fit_poses, held_out
from gravcomp.calibration.pose_intervals import covariance, design_effect, mistaken, not_shown, systematic
from gravcomp.calibration.pose_prediction import PosePredictor
from gravcomp.calibration.pose_table import read_poses
from gravcomp.calibration.pose_unknowns import unknowns_of
from gravcomp.calibration.poses import Poses
from gravcomp.commands.__main__ import main
from gravcomp.config import ConfigError, from_mapping
from gravcomp.description import Cable, Elements, Material, PointLoad, Robot, Segment
from gravcomp.experiments import measured
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.statics import StaticSolver
from gravcomp.full_model.wrench import Wrench
from gravcomp.mesh import MeshError
from gravcomp.simulation import RobotModel, Simulator

GRAVITY = np.array([-9.81, 0.0, 0.0])
MATERIAL = Material("neo_hookean", 0.5e6, 0.45, density=1100.0)
ELEMENTS = Elements(around=4, along=8, grading=1.0, equal_stiffness=True)
CABLE = Cable("c", 0.0, 3e-3, segment="a")
ROBOT = Robot("bar", segments=(Segment("a", 0.1, 12e-3, material=MATERIAL),), cables=(CABLE,), elements=ELEMENTS)
AT = np.array([[0.0, 20e-3, 40e-3], [0.0, -15e-3, 70e-3], [0.0, 0.0, 110e-3], [3e-3, 0.0, 50e-3]])


def test_a_weight_on_the_axis_bends_as_a_force_does():
    hung = dataclasses.replace(ROBOT, loads=(PointLoad((0.0, 0.0, 0.1), 5e-3),))
    with_load = Simulator(hung, reduced=False).solve(GRAVITY).tip_position
    with_force = Simulator(ROBOT, reduced=False).solve(GRAVITY, wrench=Wrench(force=5e-3 * GRAVITY)).tip_position
    assert with_load == pytest.approx(with_force, abs=0.3e-3)
    assert RobotModel(hung).mass == pytest.approx(RobotModel(ROBOT).mass + 5e-3)


def test_a_weight_outside_the_body_is_refused_with_its_distance():
    with pytest.raises(MeshError, match=r"loads\[0\]: the point \(20, 0, 100\) mm lies 14 mm outside the body"):
        RobotModel(dataclasses.replace(ROBOT, loads=(PointLoad((20e-3, 0.0, 0.1), 5e-3),)))


def test_markers_rest_where_they_are_described_and_move_rigidly_outside():
    model = RobotModel(ROBOT)
    markers = Markers(model, AT)
    assert markers.rigid.tolist() == [True, True, True, False]
    assert markers.positions(np.zeros_like(model.mesh.nodes)) == pytest.approx(AT, abs=1e-9)
    state = StaticSolver(model).solve(GRAVITY, CableInput())
    moved = markers.positions(state.u)
    pair = Markers(model, np.array([[0.0, 20e-3, 0.11], [0.0, -20e-3, 0.11]])).positions(state.u)
    assert np.linalg.norm(pair[0] - pair[1]) == pytest.approx(40e-3, abs=1e-9)
    assert (moved[:, 0] < AT[:, 0] - 0.5e-3).all()


def known_poses(offset: np.ndarray) -> Poses:
    """Poses of the robot at 0.4 MPa whose base is shifted by `offset` (3,) in m."""
    tension = np.array([[0.0], [1.0], [2.0]])
    poses = Poses(
        "known",
        ("a", "b", "c"),
        np.tile(GRAVITY, (3, 1)),
        tension,
        None,
        ((), (), ()),
        ("1", "2", "3", "4"),
        AT,
        np.zeros((3, 4, 3)),
    )
    parameters = dataclasses.replace(PosePredictor(ROBOT, poses).initial(), youngs_modulus=0.4e6)
    return dataclasses.replace(poses, measured=PosePredictor(ROBOT, poses).predict(parameters) + offset)


def test_a_fit_finds_the_modulus_and_the_base_and_predicts_a_pose_it_has_not_seen():
    offset = np.array([2e-3, -1e-3, 0.0])
    poses = known_poses(offset)
    exact = PosePriors(noise_share=0.1e-3 / ROBOT.length)
    fit = fit_poses(ROBOT, poses, (MODULUS, *base_unknowns(ROBOT, exact)), priors=exact)
    assert fit.parameters.youngs_modulus == pytest.approx(0.4e6, rel=0.01)
    assert fit.parameters.base_position == pytest.approx(offset, abs=0.1e-3)
    assert fit.rms < 0.05e-3 < fit.rms_before
    assert all(estimate.interval > 0 for estimate in fit.estimates)
    assert robot_of_poses(ROBOT, fit.parameters).segments[0].material.youngs_modulus == fit.parameters.youngs_modulus
    left_out = held_out(ROBOT, poses, (MODULUS,), [np.array([2])], start=np.array([np.log(0.8)]))
    assert np.isnan(left_out[:2]).all() and np.isfinite(left_out[2]).all()


def test_residuals_that_are_alike_count_once():
    rng = np.random.default_rng(1)
    single = rng.normal(size=(8, 4, 3))
    assert design_effect(single) < 1.5
    of_marker = 0.1 * single + rng.normal(size=(1, 4, 3))  # markers that are not placed as described
    of_pose = 0.1 * single + rng.normal(size=(8, 1, 3))
    assert design_effect(of_marker) == pytest.approx(8.0, rel=0.05)
    assert design_effect(of_pose) == pytest.approx(4.0, rel=0.05)


def test_an_error_of_the_model_goes_into_the_unknowns_that_follow_it():
    rng = np.random.default_rng(3)
    jacobian, free = rng.normal(size=(30, 2)), np.array([False, False])
    assert systematic(jacobian, jacobian @ [-0.02, 0.5], free) == pytest.approx([0.02, 0.5], rel=1e-4)
    change = jacobian @ [-0.02, 0.5]
    change[4] = np.nan
    assert systematic(jacobian, change, free) == pytest.approx([0.02, 0.5], rel=1e-4)
    assert systematic(jacobian, 1e3 * jacobian @ [0.0, 1.0], np.array([False, True]))[1] < 1e3


def test_a_marker_that_was_taken_for_another_one_is_named():
    residual = 1e-3 * np.random.default_rng(4).normal(size=(5, 3, 3))
    assert not mistaken(residual, "abcde", "xyz")
    residual[3, 1, 0] += 0.05
    (sentence,) = mistaken(residual, "abcde", "xyz")
    assert sentence.startswith("Marker y of pose d is ")


def elastica(modulus: float, gravity: np.ndarray, stations: np.ndarray) -> np.ndarray:
    """Return the axis (p, 3) at `stations` of ROBOT as an inextensible rod under its weight: the elastica."""
    from scipy.integrate import solve_bvp

    length, diameter = ROBOT.length, ROBOT.segments[0].outer_diameter
    weight = MATERIAL.density * np.pi * diameter**2 / 4 / (modulus * np.pi * diameter**4 / 64)

    def slope(s, y):
        across = gravity[0] * np.cos(y[0]) - gravity[2] * np.sin(y[0])
        return np.vstack([y[1], -weight * (length - s) * across, np.sin(y[0]), np.cos(y[0])])

    s = np.linspace(0.0, length, 51)
    found = solve_bvp(slope, lambda a, b: np.array([a[0], b[1], a[2], a[3]]), s, np.vstack([0 * s, 0 * s, 0 * s, s]))
    _, _, x, z = found.sol(stations)
    return np.column_stack([x, 0 * x, z])


def test_the_interval_of_the_modulus_holds_that_of_a_rod():
    """A solid's clamp resists the contraction across, a rod's does not. The residuals hardly show it: 1 % of the sag."""
    bar = dataclasses.replace(ROBOT, cables=()).with_material(poissons_ratio=0.49)
    at = np.array([[0.0, 0.0, z] for z in (40e-3, 70e-3, 100e-3)])
    gravity = np.array([[-9.81, 0.0, 0.0], [-8.6, 0.0, 4.7]])
    measured_at = np.array([elastica(0.5e6, g, at[:, 2]) for g in gravity])
    poses = Poses("rod", ("a", "b"), gravity, None, None, ((), ()), ("p", "q", "r"), at, measured_at)
    fit = fit_poses(bar, poses, (MODULUS,))
    (modulus,) = fit.estimates
    off = abs(modulus.value - 500.0)
    assert fit.rms < 0.01 * np.abs(measured_at - at).max()
    assert 1.96 * PosePriors().stiffness * modulus.value < off < modulus.interval < 4.0 * off


def test_what_the_poses_do_not_show_is_said():
    prior = np.array([False, True, True])
    names = ["modulus", "gain", "base"]
    shown = np.diag([1e-4, 0.01, 0.04])
    assert not not_shown(names, shown, prior)
    (hidden,) = not_shown(names, np.diag([1e-4, 0.01, 0.9]), prior)
    assert "hardly show base:" in hidden
    matrix = shown.copy()
    matrix[0, 1] = matrix[1, 0] = 0.98e-3
    (together,) = not_shown(names, matrix, prior)
    assert "modulus and gain together only (correlation +0.98)" in together


def test_an_unknown_that_moves_no_marker_is_not_shown():
    jacobian = np.zeros((24, 2))
    jacobian[:, 1] = 1.0
    matrix = covariance(jacobian, np.random.default_rng(2).normal(size=(4, 2, 3)), np.array([False, True]))
    (hidden,) = not_shown(["modulus", "base"], matrix, np.array([False, True]))
    assert "hardly show modulus:" in hidden and matrix[0, 0] > 100.0


def test_poses_under_the_robots_weight_alone_show_modulus_over_density():
    poses = known_poses(np.zeros(3))
    pulled = fit_poses(ROBOT, poses.rows([0, 1]), (MODULUS,))
    assert not any("over density" in sentence for sentence in pulled.open)
    hanging = fit_poses(ROBOT, poses.rows([0]), (MODULUS,))
    assert any("over density" in sentence for sentence in hanging.open)
    # What the model lacks is in the interval, however well the poses fit.
    assert hanging.estimates[0].interval > 1.96 * PosePriors().stiffness * hanging.estimates[0].value


def test_a_fit_leaves_cables_inside_the_body_and_refuses_those_that_it_cannot_move():
    predictor = PosePredictor(ROBOT, known_poses(np.zeros(3)))
    outside = dataclasses.replace(predictor.initial(), tip_radius=np.array([4e-3]))
    assert np.isnan(predictor.predict(outside)).all()
    through = dataclasses.replace(ROBOT, cables=(Cable("c", via_points=((3e-3, 0.0, 0.0), (3e-3, 0.0, 0.1))),))
    assert unknowns_of(("modulus", "zeros"), through)
    with pytest.raises(MeasurementError, match="'c' has via_points_mm; a fit moves only"):
        unknowns_of(("angles",), through)
    tapered = dataclasses.replace(ROBOT, cables=(dataclasses.replace(CABLE, follow_taper=True),))
    with pytest.raises(MeasurementError, match="'c' has follow_taper"):
        unknowns_of(("tip_radius",), tapered)


MAPPING = """
pose: case
gravity_columns: [gx, gy, gz]
cables: {input: tension, unit: N, columns: {c: pull_n}}
mass_columns: [{at_mm: [0, 0, 100], column: weight_g}]
frame: {rpy_deg: [0, 0, 90]}
markers:
  - {name: m, at_mm: [0, 20, 40], columns: [m_x_mm, m_y_mm, m_z_mm]}
fit: [modulus, gain]
"""
TABLE = "case,gx,gy,gz,pull_n,weight_g,m_x_mm,m_y_mm,m_z_mm\nfirst,0,-9.81,0,1.5,20,-20,1,40\nsecond,0,-9.81,0,0,0,-20,2,40\n"


@pytest.fixture
def mapping(tmp_path) -> Mapping:
    path = tmp_path / "mapping.yaml"
    path.write_text(MAPPING, encoding="utf-8")
    return load_mapping(path)


def read(tmp_path, mapping: Mapping, table: str) -> Poses:
    path = tmp_path / "poses.csv"
    path.write_text(table, encoding="utf-8")
    return read_poses(path, mapping, ("c",))


@pytest.mark.parametrize(("unit", "words"), [("cm", "10 times as far"), ("m", "1000 times as far")])
def test_markers_in_another_unit_than_the_mapping_says_are_refused(tmp_path, mapping, unit, words):
    marker = dataclasses.replace(mapping.markers[0], columns=("x", "y", "z"), unit=unit)
    second = dataclasses.replace(marker, name="n", at=(0.0, 0.0, 0.11), columns=("a", "b", "c"))
    table = "case,gx,gy,gz,pull_n,weight_g,x,y,z,a,b,c\nfirst,0,-9.81,0,1.5,20,-20,1,40,-20,1,110\n"
    place = dataclasses.replace(marker, at=(0.0, 0.0, 0.04))
    with pytest.raises(MeasurementError, match=words):
        read(tmp_path, dataclasses.replace(mapping, markers=(place, second)), table)


def test_markers_of_a_robot_that_curls_up_are_read(tmp_path, mapping):
    base, tip = (
        dataclasses.replace(mapping.markers[0], name=name, at=(0.0, 0.0, z), columns=columns, unit="mm")
        for name, z, columns in (("m", 0.01, ("x", "y", "z")), ("n", 0.11, ("a", "b", "c")))
    )
    rows = ["first,0,-9.81,0,1.5,20,0,0,10,0,0,108", *(f"{k},0,-9.81,0,1.5,20,0,0,10,8,0,{12 + k}" for k in range(4))]
    table = "\n".join(["case,gx,gy,gz,pull_n,weight_g,x,y,z,a,b,c", *rows]) + "\n"
    assert read(tmp_path, dataclasses.replace(mapping, markers=(base, tip)), table).count == 5


def test_a_table_is_read_in_the_frame_of_the_base(tmp_path, mapping):
    poses = read(tmp_path, mapping, TABLE)
    assert poses.name == ("first", "second")
    assert poses.gravity == pytest.approx(np.array([[-9.81, 0.0, 0.0]] * 2))
    assert poses.tension == pytest.approx(np.array([[1.5], [0.0]]))
    assert poses.loads == ((PointLoad((0.0, 0.0, 0.1), 20e-3),), ())
    assert poses.measured[:, 0] == pytest.approx(1e-3 * np.array([[1.0, 20.0, 40.0], [2.0, 20.0, 40.0]]))
    assert [unknown.name for unknown in unknowns_of(mapping.fit, ROBOT)] == ["Young's modulus", "tension gain"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("pull_n", "pull", "the column 'pull_n' is missing; found: case, gx"),
        ("1.5,20", ",20", "line 2: pull_n is empty"),
        ("1.5,20", "strong,20", "line 2: pull_n is 'strong'"),
        ("1.5,20", "-1.5,20", "line 2: the tension of 'c' is -1.5 N"),
        ("-9.81", "-1.0", r"line 2: gravity is 1 m/s\^2 long \(in g, not in m/s\^2\?\); 9.81 \+- 10%, or 0, is needed"),
        ("weight_g", "pull_n", "the column 'pull_n' is there 2 times; it must be unique"),
        ("case,gx,gy,gz,pull_n,weight_g,m_x_mm,m_y_mm,m_z_mm", "case\tgx\tgy", "separated by tabs; commas are needed"),
        ("case", "PK\x03\x04", "is not a UTF-8 text file; export the table as CSV"),
    ],
)
def test_a_table_that_cannot_be_read_is_named(tmp_path, mapping, old, new, words):
    with pytest.raises(MeasurementError, match=words):
        read(tmp_path, mapping, TABLE.replace(old, new, 1))


@pytest.mark.parametrize(
    ("fit", "words"),
    [
        ("[]", "fit contains nothing; allowed: one or more of modulus"),
        ("[gain, modulus, gain]", "fit contains 'gain' more than once"),
    ],
)
def test_a_mapping_that_fits_nothing_or_the_same_twice_is_refused(tmp_path, fit, words):
    (tmp_path / "m.yaml").write_text(MAPPING.replace("[modulus, gain]", fit), encoding="utf-8")
    with pytest.raises(ConfigError, match=words):
        load_mapping(tmp_path / "m.yaml")


def test_mixed_units_are_named(tmp_path, mapping):
    mixed = dataclasses.replace(mapping, markers=(dataclasses.replace(mapping.markers[0], unit="m"),))
    with pytest.raises(MeasurementError, match="'m_x_mm' ends in the unit mm, and the mapping says m"):
        read(tmp_path, mixed, TABLE)


def test_the_base_follows_from_three_markers_on_it(tmp_path):
    entries = [
        {"name": n, "at_mm": at, "columns": [f"{n}_x_mm", f"{n}_y_mm", f"{n}_z_mm"]}
        for n, at in zip("pqr", ([0, 0, 0], [10, 0, 0], [0, 10, 0]))
    ]
    document = {
        "gravity": [0, 0, 9.81],
        "frame": {"markers": entries},
        "markers": [{**entries[0], "name": "tip", "at_mm": [0, 0, 100]}],
    }
    found = from_mapping(Mapping, document, source="m.yaml")
    header = ",".join(f"{n}_{axis}_mm" for n in "pqr" for axis in "xyz")
    poses = read(tmp_path, found, f"{header}\n5,0,0,5,10,0,-5,0,0\n")  # turned by 90 degrees about z
    assert poses.measured[0, 0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert poses.gravity[0] == pytest.approx([0.0, 0.0, 9.81])
    with pytest.raises(ConfigError, match=r"2 markers on the base are given \(p, q\); a pose needs at least 3"):
        from_mapping(Mapping, document | {"frame": {"markers": entries[:2]}}, source="m.yaml")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fit": ["base"]}, "fit contains base, whose pose needs at least 3 markers; 1 given"),
        ({"gravity": None}, "neither of gravity and gravity_columns"),
        ({"cables": {"input": "tension", "unit": "mm", "columns": {}}}, "input is tension and unit is mm; allowed: N"),
        ({"fit": ["stiffness"]}, "allowed: one of modulus, gain"),
    ],
)
def test_a_mapping_that_cannot_be_is_refused(change, words):
    document = {"gravity": [0, 0, 9.81], "markers": [{"name": "m", "at_mm": [0, 0, 1], "columns": ["x", "y", "z"]}]} | change
    with pytest.raises(ConfigError, match=words):
        from_mapping(Mapping, document, source="m.yaml")


def test_a_chain_bends_to_an_arc_and_leaves_slack_tendons_alone():
    chain = Chain(np.array([0.1]), 5e-3, 0.0, np.zeros(3, dtype=int))
    angle = np.radians([0.0, 120.0, 240.0])
    pulled = np.array([[2e-3, -5e-3, -5e-3]])
    bends, taut = chain.bends(pulled, angle, 1e12)
    assert taut.tolist() == [[True, False, False]]
    assert bends[0, 0] == pytest.approx([0.4, 0.0], rel=1e-4)
    assert chain.tips(bends)[0] == pytest.approx(0.25 * np.array([1 - np.cos(0.4), 0.0, np.sin(0.4)]), rel=1e-3)


def test_calibrate_fits_a_table_and_writes_the_robot(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.yaml").write_text(
        "robot:\n  name: bar\n  segments:\n    - {name: a, length_mm: 100, outer_diameter_mm: 12, material: {law: neo_hookean,"
        " youngs_modulus_mpa: 0.5, density: 1100}}\n  elements: {around: 4, along: 8, grading: 1, equal_stiffness: true}\n",
        encoding="utf-8",
    )
    (tmp_path / "mapping.yaml").write_text(
        "gravity: [-9.81, 0, 0]\nmarkers: [{name: m, at_mm: [0, 0, 100], columns: [x_mm, y_mm, z_mm]}]\n", encoding="utf-8"
    )
    bare = dataclasses.replace(ROBOT, cables=())
    tip = 1e3 * Simulator(bare.with_material(youngs_modulus=0.4e6), reduced=False).solve(GRAVITY).tip_position
    (tmp_path / "poses.csv").write_text(f"x_mm,y_mm,z_mm\n{tip[0]},{tip[1]},{tip[2]}\n", encoding="utf-8")
    assert (
        main(["calibrate", "poses.csv", "--mapping", "mapping.yaml", "--robot", "robot.yaml", "--write", "out.yaml", "--json"])
        == 0
    )
    assert "written" in capsys.readouterr().out
    (segment,) = yaml.safe_load((tmp_path / "out.yaml").read_text(encoding="utf-8"))["robot"]["segments"]
    assert segment["material"]["youngs_modulus_mpa"] == pytest.approx(0.4, rel=0.02)


def test_a_folder_without_measurements_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="contains none of the folders tentacle, beam"):
        measured.run(tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(not (measured.default_folder() / "disks").is_dir(), reason="needs the folder disks in GRAVCOMP_DATA")
def test_robots_with_disks_go_where_others_compute():
    result = measured.run(measured.default_folder(), names=("disks",), brief=True)
    assert result.data["disks_error_pct"] < 0.3
