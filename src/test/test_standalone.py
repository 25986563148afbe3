"""The loop on the board: its C code against the host's loop, in the image bit for bit, and models that it refuses."""

import ctypes
import dataclasses
import struct

import numpy as np
import pytest
from coarse_article import built_once, cache_of_the_run, coarse

from gravcomp.closed_loop import loop as loop_module
from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.commands.__main__ import main
from gravcomp.config import ConfigError
from gravcomp.description import PronyTerm, load_robot_file
from gravcomp.external_loads.base_turn import BaseTurn
from gravcomp.firmware import model_blob
from gravcomp.firmware.cycles import MEMORY_AT, Processor, sample_bytes
from gravcomp.firmware.host_library import load as library
from gravcomp.firmware.image import build_image
from gravcomp.firmware.loop_on_host import LOADING_STEPS, run_on_host, turning_gravity
from gravcomp.firmware.model_fit import LONGEST_MS, SLOT_BYTES, error_of_loop, fit
from gravcomp.firmware.model_settings import BRANCHES_MAX, CABLES_MAX, SAMPLE_PERIOD, LoopParameters, settings
from gravcomp.firmware.standalone_loop import StandaloneLoop
from gravcomp.orientation import GravityEstimator
from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.guard import Problem
from gravcomp.simulation import RobotModel
from gravcomp.virtual.motion import StaticMotion, base_orientation

pytestmark = pytest.mark.slow

STEPS = 120


@pytest.fixture(scope="module")
def parameters():
    file = load_robot_file("article")
    return LoopParameters.of(dataclasses.replace(file, robot=coarse(file.robot)))


@pytest.fixture(scope="module")
def built(parameters, tmp_path_factory):
    """A coarse model and its reduction."""
    with cache_of_the_run(tmp_path_factory):
        yield built_once(parameters.robot)


@pytest.fixture(scope="module")
def found(parameters, built):
    return fit(*built, parameters)


def started(blob: bytes, gravity: np.ndarray) -> StandaloneLoop:
    loop = StandaloneLoop(blob)
    for _ in range(LOADING_STEPS - 1):
        assert loop.follow(SAMPLE_PERIOD, gravity)
    return loop


def test_the_loop_in_float32_follows_that_of_the_host(parameters, built, found):
    assert found.milliseconds <= LONGEST_MS and len(found.blob) <= SLOT_BYTES and found.error < 0.05e-3
    path = turning_gravity(np.radians(90.0), 0, 0)[:STEPS]  # from the hanging robot
    host = run_on_host(built[0], parameters, path)
    loop = started(found.blob, path[0])
    for step, gravity in enumerate(path):
        assert loop.follow(SAMPLE_PERIOD, gravity)
        result = loop.read()
        assert result.converged
        if step > 20:  # both have settled; the host may use the full model
            assert np.linalg.norm(result.tip - host.tip[step]) < 0.15e-3
            np.testing.assert_allclose(result.displacement, host.command[step], atol=0.15e-3)
    assert result.code == 1


def test_the_error_of_the_loop_on_the_board_is_that_of_equal_pulls_while_they_rise(parameters, built, found):
    """A robot that gravity draws across is pulled from the first step on."""
    model, reduction = built
    run = run_on_host(model, parameters, np.tile((-9.81, 0.0, 0.0), (10, 1)), rise=True)
    assert error_of_loop(found.blob, reduction.reduced_model(model), model, run) < 0.15e-3


def test_the_joystick_bends_the_robot_toward_it(parameters, found):
    loop = started(found.blob, np.array([0.0, 0.0, -9.81]))
    loop.steer(0.2, 0.0)
    for _ in range(150):
        loop.follow(SAMPLE_PERIOD, (0.0, 0.0, -9.81))
    tip = loop.read().tip
    bend = 0.2 * np.pi / 3
    assert tip[0] == pytest.approx(parameters.robot.length * (1.0 - np.cos(bend)) / bend, abs=1e-3)
    assert abs(tip[1]) < 0.5e-3


def test_a_lost_equilibrium_holds_the_robot_at_its_last_one(found):
    loop = started(found.blob, np.array([0.0, 0.0, -9.81]))
    for _ in range(60):
        loop.follow(SAMPLE_PERIOD, (0.0, 0.0, -9.81))
    before = loop.read()
    loop.follow(SAMPLE_PERIOD, (-900.0, 0.0, 0.0))
    after = loop.read()
    assert not after.converged
    np.testing.assert_array_equal(after.tip, before.tip)
    np.testing.assert_allclose(after.displacement, before.displacement, atol=1e-5)
    for _ in range(100):
        loop.follow(SAMPLE_PERIOD, (0.0, 0.0, -9.81))
    assert loop.read().converged and np.all(np.isfinite(loop.read().displacement))


def test_a_jolt_that_loses_the_equilibrium_does_not_lose_it_for_good(found):
    lost, left = 0, []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        gravity, jolt = (size * axis / np.linalg.norm(axis) for size, axis in zip((9.81, 100.0), rng.normal(size=(2, 3))))
        loop, steps = started(found.blob, gravity), int(rng.integers(5, 60))
        for k in range(steps):
            loop.follow(SAMPLE_PERIOD, gravity + (k + 1) / steps * jolt)
            lost += not loop.read().converged
        for _ in range(200):
            loop.follow(SAMPLE_PERIOD, gravity)
        left.append(loop.read())
    assert lost > 20
    assert sum(result.converged for result in left) >= 10  # some try for longer


def changed(blob: bytes, at: int, value: int) -> bytes:
    return model_blob.with_crc(blob[:at] + struct.pack("<I", value) + blob[at + 4 :])


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda b: b[:40], "cut off"),
        (lambda b: b[:-8], "cut off"),
        (lambda b: b + bytes(8), "size"),
        (lambda b: b"GCMX" + b[4:], "no blob"),
        (lambda b: changed(b, 4, 1), "another version"),
        (lambda b: changed(b, 32, 52), "more modes"),
        (lambda b: changed(b, 40, CABLES_MAX + 1), "more modes"),
        (lambda b: changed(b, 44, model_blob.PIECES_MAX + 1), "pieces of cables"),
        (lambda b: changed(b, 52, model_blob.POINTS_MAX + 1), "points"),
        (lambda b: changed(b, 56, model_blob.LAW_POINTS_MAX + 1), "points"),
        (lambda b: changed(b, 60, BRANCHES_MAX + 1), "branches"),
        (lambda b: changed(b, 8, len(b) - 4), "size"),
        (lambda b: b[:200] + bytes([b[200] ^ 1]) + b[201:], "CRC"),
        (lambda b: changed(b, 16, 0), "another robot"),
        (lambda b: changed(b, 80, 0x7FC00000), "not finite"),
    ],
)
def test_a_spoilt_model_is_refused_and_the_old_one_goes_on(found, spoil, reason):
    gravity = np.array([-4.0, 0.0, -8.9])
    loop, untouched = started(found.blob, gravity), started(found.blob, gravity)
    assert reason in loop.load(spoil(found.blob))
    for each in (loop, untouched):
        each.follow(SAMPLE_PERIOD, gravity)
    np.testing.assert_array_equal(loop.read().displacement, untouched.read().displacement)


def test_the_settings_have_the_length_that_the_firmware_reads(parameters, built):
    turn = BaseTurn(built[0], parameters.turn)
    library().gc_loop_settings.restype = ctypes.c_size_t
    assert len(settings(parameters, 1.0, 1.0, turn)) == model_blob.SETTINGS == library().gc_loop_settings()


def test_a_robot_that_creeps_and_whose_cables_rub_does_so_on_the_board(parameters, built):
    rubbing = tuple(dataclasses.replace(cable, friction=0.1) for cable in parameters.robot.cables)
    robot = dataclasses.replace(parameters.robot, cables=rubbing)
    creeping = robot.with_material(prony=(PronyTerm(share=0.4, time=0.3), PronyTerm(share=0.2, time=3.0)))
    own, model = dataclasses.replace(parameters, robot=creeping), RobotModel(creeping)
    found, path = fit(model, built[1], own), turning_gravity(np.radians(90.0), 0, 0)[:STEPS]
    host, still = run_on_host(model, own, path), run_on_host(built[0], parameters, path)
    loop, apart = started(found.blob, path[0]), 0.0
    for step, gravity in enumerate(path):
        assert loop.follow(SAMPLE_PERIOD, gravity)
        result = loop.read()
        if step > 20:
            apart = max(apart, float(np.abs(result.displacement - host.command[step]).max()))
    memory = np.abs(host.command - still.command)[21:].max()
    assert memory > 0.15e-3 and apart < 0.3 * memory


def test_a_robot_whose_parts_creep_differently_or_by_too_many_terms_is_refused_with_the_number(parameters, built):
    terms = tuple(PronyTerm(share=0.1, time=float(k)) for k in range(1, 6))
    creeping = parameters.robot.with_material(prony=terms)
    with pytest.raises(ConfigError, match="has 5 terms in prony; the firmware has room for 4"):
        fit(RobotModel(creeping), built[1], dataclasses.replace(parameters, robot=creeping))


def test_a_robot_with_too_many_cables_is_refused_before_its_reduced_model_is_built(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("gravcomp.commands.model.build.prepare", None)
    assert main(["firmware", "model", "three_segment", "--output", str(tmp_path)]) == 2
    assert "has 9 cables; the bus of the board has room for 8 motors" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("lines", "names"),
    [
        ("scene: {planes: [{name: table, normal: [0, 1, 0], point_mm: [0, -6, 0]}]}", r"the walls of scene \(table\)"),
        (
            "scene: {spheres: [{name: vessel, centre_mm: [9, 0, 90], radius_mm: 2, forbidden: true}]}",
            r"zones of scene \(vessel\)",
        ),
        ("scene: {self_contact: true}", "scene.self_contact"),
        ("robot: {payload: {mass_g: 2.0, centre_mm: [0, 0, 15]}}", "robot.payload.centre_mm"),
        ("nodes: {fem_simulator: {payload_mass_g: 3.0}}", "payload_mass_g"),
        ("nodes: {fem_simulator: {load: {kind: payload}}}", "load.kind: payload"),
        ("nodes: {inverse_controller: {inverse: {max_contact_force: 0.1}}}", "max_contact_force"),
    ],
)
def test_what_the_board_does_not_know_is_refused_with_its_name(tmp_path, lines, names):
    path = tmp_path / "robot.yaml"
    path.write_text(f"base: article\n{lines}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=f"{path}: the loop on the board does not know .*{names}"):
        LoopParameters.of(load_robot_file(str(path)))
    if "scene" in lines:
        with pytest.raises(ConfigError, match=names):
            ClosedLoop(Setup.of(load_robot_file(str(path))), StaticMotion(base_orientation(0.0)), board="standalone")


def test_a_payload_at_the_tip_is_known_to_the_board(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text(
        "base: article\nrobot: {payload: {mass_g: 2.0}}\nnodes: {fem_simulator: {payload_mass_g: 2.0}}\n", encoding="utf-8"
    )
    assert LoopParameters.of(load_robot_file(str(path))).robot.payload.mass == pytest.approx(0.002)


def test_the_estimator_in_float32_follows_that_of_the_host(parameters, found):
    rng = np.random.default_rng(0)
    host = GravityEstimator(parameters.estimator.estimator, quat.from_roll_pitch_yaw(*parameters.robot.imu_mount.rpy))
    loop, orientation, worst = StandaloneLoop(found.blob), quat.IDENTITY, 0.0
    for k in range(1500):
        rate = np.zeros(3) if k < 500 else np.array([1.0, -0.5, 0.3]) * np.sin(0.01 * k)
        orientation = quat.normalised(quat.multiply(orientation, quat.exponential(*(0.01 * rate))))
        accel = np.array(quat.rotate(quat.conjugate(orientation), (0.0, 0.0, 9.81))) + rng.normal(0.0, 0.02, 3)
        gyro = rate + 0.01 + rng.normal(0.0, 1e-3, 3)
        if k % 217 == 100:
            gyro[0] += 20.0  # a spike
        if k in (700, 701):
            continue  # samples are lost
        estimate = host.update(k * 10_000_000, gyro.tolist(), accel.tolist())
        assert loop.weigh(k * 10_000, gyro, accel)
        worst = max(worst, float(np.linalg.norm(np.subtract(loop.gravity, estimate.gravity))))
    assert np.degrees(worst / 9.81) < 0.05


def test_the_forces_of_a_turning_base_are_those_of_the_host(parameters, built, found):
    """Over lost samples, one of an unknown kind, and a pause after which the rates begin again."""
    estimator = GravityEstimator(parameters.estimator.estimator, quat.from_roll_pitch_yaw(*parameters.robot.imu_mount.rpy))
    mount, turn, loop = parameters.robot.imu_mount.rotation, BaseTurn(built[0], parameters.turn), StandaloneLoop(found.blob)
    orientation, worst, largest = quat.IDENTITY, 0.0, 0.0
    for k in range(600):
        gyro = np.array([1.0, -0.5, 0.3]) * np.sin(0.05 * k)
        orientation = quat.normalised(quat.multiply(orientation, quat.exponential(*(0.01 * gyro))))
        if k in (200, 201) or 400 <= k < 420:
            continue
        accel = np.full(3, np.nan) if k == 300 else np.array(quat.rotate(quat.conjugate(orientation), (0.0, 0.0, 9.81)))
        estimate = estimator.update(k * 10_000_000, gyro.tolist(), accel.tolist())
        if not isinstance(estimate, Problem):
            turn.add(0.01 * k, mount @ np.array(estimate.imu.angular_velocity))
        wanted = turn.acceleration(0.01 * k)
        assert loop.weigh(k * 10_000, gyro, accel) == (k != 300)
        worst = max(worst, float(np.linalg.norm(loop.read().turning - wanted)))
        largest = max(largest, float(np.linalg.norm(wanted)))
        if k in (0, 420):
            assert not loop.read().turning.any()
    assert largest > 0.1 and worst < 1e-4 * largest
    last, without = loop.read(), StandaloneLoop(found.blob)
    loop.follow(SAMPLE_PERIOD)
    without.follow(SAMPLE_PERIOD, last.gravity)
    alike = StandaloneLoop(found.blob)
    alike.follow(SAMPLE_PERIOD, last.gravity + last.turning)
    np.testing.assert_allclose(loop.read().tip, alike.read().tip, rtol=0.0, atol=1e-9)
    assert np.linalg.norm(loop.read().tip - without.read().tip) > 1e-6


def test_a_turn_that_does_not_count_has_no_forces_on_the_board(parameters, built):
    file = load_robot_file("article")
    nodes = {**file.section("nodes"), "fem_simulator": {"turn": {"enabled": False}}}
    off = LoopParameters.of(dataclasses.replace(file, robot=parameters.robot, sections={**file.sections, "nodes": nodes}))
    values = [settings(each, 1.0, 1.0, BaseTurn(built[0], each.turn)) for each in (parameters, off)]
    height, lag = np.flatnonzero(values[0] != values[1])
    assert values[0][height] == pytest.approx(BaseTurn(built[0], off.turn).height) and values[0][lag] > 0.0
    assert not values[1][[height, lag]].any()


def test_the_estimator_looks_at_rates_twice_and_evens_stamps_as_that_of_the_host(parameters, found):
    """A sensor that is shaken so fast that the first look finds spikes where there are none, with jitter, vibration and gaps."""
    rng = np.random.default_rng(3)
    host = GravityEstimator(parameters.estimator.estimator, quat.from_roll_pitch_yaw(*parameters.robot.imu_mount.rpy))
    loop, orientation, worst = StandaloneLoop(found.blob), quat.IDENTITY, 0.0
    for k in range(2000):
        rate = np.zeros(3) if k % 700 < 400 else np.array([6.0, -4.0, 5.0]) * np.sin(0.01 * k * np.array([50.0, 57.0, 63.0]))
        orientation = quat.normalised(quat.multiply(orientation, quat.exponential(*(0.01 * rate))))
        accel = np.array(quat.rotate(quat.conjugate(orientation), (0.0, 0.0, 9.81))) + rng.normal(0.0, 0.02, 3)
        gyro = rate + 0.01 + rng.normal(0.0, 1e-3, 3)
        if k % 31 == 30:
            gyro[k % 3] += rng.choice([-3.0, 3.0])  # a spike
        if k > 400:
            accel += 4.0 * np.sin(k * np.array([2.9, 2.7, 2.5]))  # vibration
            accel += rng.choice([-20.0, 20.0], 3) if k % 53 == 50 else 0.0
        stamp = 10_000 * k + int(rng.integers(-3000, 3000))
        if 1150 <= k < 1180 or 1500 <= k < 1503 or 1850 <= k < 1940:
            continue  # in fast motion, at rest, and while the motion ends
        estimate = host.update(1000 * stamp, gyro.tolist(), accel.tolist())
        assert loop.weigh(stamp, gyro, accel)
        worst = max(worst, float(np.linalg.norm(np.subtract(loop.gravity, estimate.gravity))))
    assert np.degrees(worst / 9.81) < 0.05


def test_the_image_computes_the_same_bits_as_the_host(found):
    """The inner loops are written in the processor's instructions there."""
    processor, loop = Processor(build_image(standalone=True), found.blob), StandaloneLoop(found.blob)
    sample, targets = MEMORY_AT + 0x17000, MEMORY_AT + 0x17100
    assert processor.take_model(found.blob)
    on_host = (ctypes.c_float * 8)(), (ctypes.c_float * 8)()
    memory = ctypes.create_string_buffer(24)
    for k in range(LOADING_STEPS + 5):
        spike = 9000 if k % 16 == 15 else 0
        data = sample_bytes([5000, 100 + k, -2000, 3 * k + spike, 20, -10], 10_000 * k, 1, 0)
        processor.write(sample, data)
        processor.call("gc_standalone_step", MEMORY_AT, sample, 0xFF, targets, targets + 32)
        ctypes.memmove(memory, data, 24)
        library().gc_standalone_step(ctypes.c_void_p(loop.address), memory, 0xFF, *on_host)
    assert any(on_host[0]) and processor.read(targets, 64) == bytes(on_host[0]) + bytes(on_host[1])


def test_the_board_holds_the_virtual_robot_by_itself(parameters, built, found, monkeypatch):
    monkeypatch.setattr(loop_module, "blob_for", lambda _: found.blob)
    setup = dataclasses.replace(Setup.of(load_robot_file("article")), robot=parameters.robot)
    loop = ClosedLoop(setup, StaticMotion(base_orientation(np.radians(135.0))), board="standalone")
    sagging = np.linalg.norm(loop.truth.tip_position[:2])
    loop.hold(parameters.at_rest)
    loop.run(1.5)
    assert loop.virtual.firmware.word("motors") == 0b111111 and loop.virtual.firmware.loop().code == 1
    assert np.linalg.norm(loop.truth.tip_position[:2]) < 0.06 * sagging
    loop.release()
    assert np.abs(loop.truth.current).max() > 0.0
    loop.run(0.1)
    assert not loop.truth.current.any()
