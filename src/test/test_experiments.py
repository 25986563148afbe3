"""Experiments: measures, beam theories, report pages, lumens, and the closed loop in the core."""

import json
import sys
import types
from concurrent.futures import Future

import numpy as np
import pytest

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.config import ConfigError
from gravcomp.description import Material, load_robot_file
from gravcomp.evaluation import metrics
from gravcomp.experiments import EXPERIMENTS, experiment
from gravcomp.experiments.steering import nearly_weightless
from gravcomp.mesh.tube import tube_mesh
from gravcomp.references import calculix
from gravcomp.references.beams import Tube, elastica, euler_bernoulli
from gravcomp.report.page import write_index, write_report
from gravcomp.report.result import Figure, Plot, Result, Table, number
from gravcomp.sweep import Sweep
from gravcomp.trials.free_fall import free_fall, true_fall
from gravcomp.trials.holding import Case, target_of
from gravcomp.trials.lumen import Lumen
from gravcomp.trials.resting_imu import gravity_at_rest
from gravcomp.virtual.motion import StaticMotion, base_orientation


def test_recovery_rate_is_blind_to_offsets_and_sees_phase():
    t = np.linspace(0, 4 * np.pi, 400)[:, None]
    course = np.hstack([np.sin(t), 0.3 * np.cos(2 * t), 0 * t])
    assert metrics.recovery_rate(course, course + np.array([1.0, -2.0, 3.0])) == pytest.approx(1.0)
    assert metrics.recovery_rate(course, -course) == pytest.approx(-1.0)
    assert metrics.recovery_rate(course, np.roll(course, 50, axis=0)) < 0.5
    assert np.isnan(metrics.recovery_rate(course, np.ones_like(course)))


def test_tip_errors_split_the_distance():
    direction = np.array([0.0, 0.6, 0.8])
    target = np.array([0.01, 0.0, 0.1])
    tip = target + 2e-3 * direction + 1e-3 * np.array([1.0, 0.0, 0.0])
    errors = metrics.tip_errors(tip[None], direction[None], target, direction)
    assert errors.axial[0] == pytest.approx(2e-3)
    assert errors.lateral[0] == pytest.approx(1e-3)
    assert errors.distance[0] == pytest.approx(np.sqrt(5) * 1e-3)
    assert errors.tilt[0] == pytest.approx(0.0, abs=1e-12)


def test_sag_is_across_the_curve_and_not_along_it():
    angle = np.linspace(0.0, 1.0, 401)
    arc = 0.1 * np.stack([1 - np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    normal = np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1)
    tangent = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    moved = arc + 2e-3 * tangent + np.linspace(0.0, 1e-3, 401)[:, None] * normal
    # The ends' tangents are one-sided differences: off by half a step.
    assert metrics.sag(moved[None], arc)[0] == pytest.approx(np.linspace(0.0, 1e-3, 401), abs=3e-6)
    assert metrics.mid_body_sag(moved[None], arc)[0] == pytest.approx(1e-3, abs=6e-6)


def test_settling_time_counts_from_the_start_to_the_last_excursion():
    time = np.arange(0.0, 10.0, 0.01)
    error = np.where(time < 3.0, 5.0, np.where(time < 4.2, 1.0, 0.1))
    assert metrics.settling_time(time, error, start=3.0, band=0.2) == pytest.approx(1.2, abs=0.011)
    assert metrics.settling_time(time, error, start=5.0, band=0.2) == 0.0


def test_elastica_becomes_euler_bernoulli_for_a_stiff_tube():
    tube = Tube(0.1, 9e-3, 3e-3, 800e6, 1150.0)
    for inclination in (0.0, 0.7, -0.7):
        # Both differ by the square of the deflection over the length, here 1e-7.
        assert elastica(tube, inclination)[0] == pytest.approx(euler_bernoulli(tube, inclination)[0], rel=1e-3)


def test_elastica_hangs_where_calculix_says_and_euler_bernoulli_does_not():
    row = next(
        r
        for r in calculix.stored_rows()
        if (r.law, r.youngs_modulus, r.inclination, r.poissons_ratio) == ("svk", 0.8e6, 0.0, 0.45)
    )
    tube = Tube(**calculix.REFERENCE, youngs_modulus=0.8e6)
    # What the elastica lacks is shear and the stiffer clamp: tenths of a millimetre.
    assert np.linalg.norm(elastica(tube, 0.0) - row.tip) < 0.3e-3
    assert np.linalg.norm(euler_bernoulli(tube, 0.0) - row.tip) > 4e-3


def test_the_tube_of_the_table_has_its_density_and_constants_of_laws_are_named():
    material = calculix.tube_robot("svk", 0.8e6).segments[0].material
    assert (material.density, material.c01_ratio) == (calculix.REFERENCE["density"], Material().c01_ratio)
    with pytest.raises(TypeError, match="positional"):
        Material("svk", 0.8e6, 0.45, 1150.0)  # type: ignore[misc]


def test_calculix_deck_describes_the_mesh_and_its_output_is_read():
    mesh = tube_mesh(calculix.tube_robot("svk", 0.8e6), around=6, along=4)
    lines = calculix.deck(mesh, np.pi / 2).splitlines()
    first = lines.index("*ELEMENT, TYPE=C3D20R, ELSET=BODY")
    assert first == len(mesh.nodes) + 1
    numbers = (lines[first + 1] + lines[first + 2]).split(",")
    assert [int(n) for n in numbers] == [1, *(mesh.elements[0] + 1)]
    gravity = lines[lines.index("*DLOAD") + 1].split(",")
    assert [float(x) for x in gravity[3:]] == pytest.approx([0.0, 0.0, -1.0], abs=1e-8)
    output = (
        " displacements (vx,vy,vz) for set TIP and time  0.5000000E+00\n\n 7  1.0E+00 0.0E+00 0.0E+00\n\n"
        " displacements (vx,vy,vz) for set TIP and time  0.1000000E+01\n\n"
        " 7  2.0E-02 0.0E+00 -1.0E-03\n 9  4.0E-02 0.0E+00 -3.0E-03\n"
    )
    assert calculix.last_displacements(output).mean(axis=0) == pytest.approx([0.03, 0.0, -0.002])
    with pytest.raises(RuntimeError, match="no displacements"):
        calculix.last_displacements("*ERROR")


def test_a_page_is_self_contained_and_says_reached_and_missed_beside_the_figures(tmp_path):
    result = Result(
        name="sample",
        title="A <sample>",
        question="?",
        ground="virtual robot",
        figures=[
            Figure("good", 0.9995, "", "> 0.99", 0.999, True),
            Figure("bad", 3.0, "mm", "", 2.0),
            Figure("lost", np.nan, "ms", "", 1.0),
        ],
        parts=[Table("T", ("a", "b"), [("x", 1.23456)]), Plot("P", "<svg></svg>")],
        parameters={"array": np.arange(2)},
    )
    page = write_report(result, tmp_path).read_text(encoding="utf-8")
    assert page.count("badge reached") == 1 + page.count(".badge reached") and page.count('class="badge missed"') == 2
    assert "A &lt;sample&gt;" in page and "src=" not in page and "http" not in page
    document = json.loads((tmp_path / "sample.json").read_text(encoding="utf-8"))
    assert document["reached"] is False
    assert [f["reached"] for f in document["figures"]] == [True, False, False]
    assert document["figures"][2]["value"] is None
    assert "1 of 3 figures" in write_index([result], tmp_path).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("value", "text"), [(0.0012345, "0.00123"), (12345.6, "12346"), (1e-7, "1.00e-07"), (float("nan"), "–"), (True, "yes")]
)
def test_numbers_are_written_for_people(value, text):
    assert number(value) == text


def test_every_experiment_has_a_module_with_a_title():
    for name in EXPERIMENTS:
        module = experiment(name)
        assert module.TITLE and callable(module.run)


def test_a_sweep_keeps_the_order_and_a_missing_cluster_is_a_clear_error():
    with Sweep(workers=1) as sweep:
        assert sweep.map(abs, [-3, 2, -1]) == [3, 2, 1]
    with pytest.raises(ConfigError, match="workers is 0"):
        Sweep(workers=0)
    with pytest.raises(ConfigError, match=r"distributed|does not answer"):
        Sweep(cluster="tcp://127.0.0.1:1").map(abs, [1])


def test_a_sweep_goes_over_a_cluster_when_given_its_address(monkeypatch):
    asked = []

    class Client:
        """What `Sweep` uses of dask.distributed.Client."""

        def __init__(self, address, timeout):
            asked.append(address)

        def map(self, function, items):
            futures = [Future() for _ in items]
            for future, item in zip(futures, items):
                future.set_result(function(item))
            return futures

        def close(self):
            asked.append("closed")

    monkeypatch.setitem(sys.modules, "dask", types.ModuleType("dask"))
    monkeypatch.setitem(sys.modules, "dask.distributed", types.SimpleNamespace(Client=Client))
    told = []
    with Sweep(cluster="tcp://here:8786") as sweep:
        assert sweep.map(abs, [-3, 2], lambda done, total: told.append((done, total))) == [3, 2]
        assert sweep.map(abs, [-1]) == [1]
    assert asked == ["tcp://here:8786", "closed"]
    assert told == [(1, 2), (2, 2)]
    assert "tcp://here:8786" in sweep.place


@pytest.mark.parametrize("robot", ["article", "tentacle"])  # its true values are given, or drawn
def test_a_robot_of_hardly_any_weight_differs_in_its_weight_only(robot):
    setup = Setup.of(load_robot_file(robot), 3)
    true, light = setup.true_robot, nearly_weightless(setup).true_robot
    assert [one.youngs_modulus for one in light.robot.materials] == [one.youngs_modulus for one in true.robot.materials]
    assert light.robot.materials[0].density == pytest.approx(true.robot.materials[0].density / 20.0, rel=0.021)  # drawn: +- 2 %
    assert light.robot.cables == true.robot.cables and light.materials == true.materials


@pytest.mark.parametrize("lumen", [Lumen(0.04, 0.07, 0.3, 0.02), Lumen(0.1, 0.0, 0.0, 0.02)])
def test_a_lumens_centreline_is_traversed_at_unit_speed_along_its_tangent(lumen):
    s, step = np.linspace(-0.05, 0.12, 60), 1e-6
    slope = (lumen.point(s + step) - lumen.point(s - step)) / (2 * step)
    # At the inlet's end the curvature jumps: the central difference is off by step / radius there.
    np.testing.assert_allclose(slope, lumen.direction(s), atol=1e-4)
    # The centreline is sampled every 0.2 mm, so points on it are half of that away at most.
    assert lumen.distance(lumen.point(s)).max() < 0.11e-3
    across = np.array([-np.sin(lumen.plane), np.cos(lumen.plane), 0.0])
    np.testing.assert_allclose(lumen.distance(lumen.point(s) + 5e-3 * across), 5e-3, atol=0.05e-3)


@pytest.fixture(scope="module")
def setup():
    return Setup.of(load_robot_file("article"))


@pytest.mark.slow
def test_the_loop_lets_the_robot_sag_and_straightens_it(setup):
    loop = ClosedLoop(setup, StaticMotion(base_orientation(0.0)))
    target = target_of(setup, Case(0.0))
    loop.release()
    loop.run(1.0)
    sagged = loop.trace.tip_position[-20:].mean(axis=0)
    loop.hold(target)
    loop.run(1.2)
    held = loop.trace.tip_position[-20:].mean(axis=0)
    assert np.linalg.norm(sagged - target.tip_position) > 20e-3
    assert np.linalg.norm(held - target.tip_position) < 3e-3
    felt, true = loop.trace.estimated_gravity[-1], loop.trace.gravity[-1]
    assert metrics.angle_between(felt, true) < np.radians(1.0)


@pytest.mark.slow
def test_gravity_of_a_resting_base_is_that_of_the_loop(setup):
    """To within the noise of another stream; the bias of the accelerometer is the same, and ten times as large."""
    base = base_orientation(np.radians(45.0), np.radians(30.0))
    loop = ClosedLoop(setup, StaticMotion(base))
    loop.run(2.0 - loop.time)
    apart = gravity_at_rest(setup, base) - loop.trace.estimated_gravity[-50:].mean(axis=0)
    assert np.linalg.norm(apart) < np.radians(0.1) * 9.81


def test_a_free_fall_begins_straight_and_ends_where_the_robot_hangs(setup):
    fall = free_fall((setup, 0.0, 0.0, 1.0, 0))
    true = true_fall((setup, 0.0, 0.0, 1.0, 0))
    tip, direction = true.tip_position, true.tip_direction
    assert tip[0] == pytest.approx([0.0, 0.0, 0.1], abs=1e-9)
    assert direction[0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    # A tracker's noise is 0.1 mm a coordinate, and half a degree of the direction; along the direction none is seen.
    assert len(fall.tip_position) == len(tip) == 101
    assert (fall.tip_position - tip).std() == pytest.approx(0.1e-3, rel=0.2)
    assert (fall.tip_direction - direction).std() == pytest.approx(np.sqrt(2 / 3) * np.radians(0.5), rel=0.2)
    assert np.linalg.norm(fall.tip_position[0] - tip[0]) < 0.6e-3
    # In free fall at first: g t^2 / 2 is 0.5 mm after 10 ms, one and a half times that at the tip.
    assert 0.3e-3 < -fall.tip_position[1, 0] < 1.2e-3
    assert fall.tip_position[:, 0].min() < -40e-3 < fall.tip_position[-1, 0] < -20e-3


def test_a_model_is_judged_by_the_true_tip_not_by_what_a_tracker_sees(setup):
    """An upright robot stays straight in all samples, whatever the noise of the tracker."""
    upright = true_fall((setup, 90.0, 0.0, 0.3, 0))
    assert np.ptp(upright.tip_direction, axis=0) == pytest.approx(0.0, abs=1e-6)
    assert upright.tip_position[:, :2] == pytest.approx(0.0, abs=1e-7)


def test_the_loop_runs_the_same_each_time(setup):
    def tips(seed_setup):
        loop = ClosedLoop(seed_setup, StaticMotion(base_orientation(0.4)))
        loop.hold(target_of(seed_setup, Case(0.0)))
        loop.run(0.1)
        return loop.trace.tip_position

    np.testing.assert_array_equal(tips(setup), tips(setup))
