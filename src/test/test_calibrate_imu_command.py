"""`gravcomp calibrate-imu`: the estimator reads the files that it writes, and they correct the errors of the IMU."""

import json
from pathlib import Path

import numpy as np
import pytest

from gravcomp.commands.__main__ import main
from gravcomp.config import from_mapping
from gravcomp.description import load_robot_file
from gravcomp.graph.parameters.imu_estimator import ImuEstimatorParameters
from gravcomp.orientation import BiasTemperatureModel, GravityEstimator, estimate_recording
from gravcomp.orientation import quaternion as quat
from gravcomp.recordings.imu import Recording, read_recording

pytestmark = pytest.mark.slow

SCALE, OFFSET = np.array([1.02, 0.99, 1.01]), np.array([0.15, -0.1, 0.2])  # m/s^2
GYRO_OFFSET = np.radians([0.8, -0.5, 0.3])
MOUNT = (1.7, -0.1, 3.0)  # roll, pitch, yaw of the IMU in soft_base
SIX = np.vstack([np.eye(3), -np.eye(3)])  # directions in soft_base that point up, one a pose


def lying_in(base_up, seconds=8.0, rate=100.0):
    """gyr, acc of an uncalibrated IMU that lies in poses, and is turned over quickly between them."""
    random = np.random.default_rng(1)
    count, turning = round(seconds * rate), round(1.0 * rate)
    gyro, accel = [], []
    for up in base_up @ quat.matrix(quat.from_roll_pitch_yaw(*MOUNT)):
        gyro += [GYRO_OFFSET + random.normal(0, 0.002, (count, 3)), random.normal(0, 1.0, (turning, 3))]
        accel += [
            9.81 * up / SCALE + OFFSET + random.normal(0, 0.02, (count, 3)),
            9.81 * up + random.normal(0, 3.0, (turning, 3)),
        ]
    return {"gyr": np.vstack(gyro), "acc": np.vstack(accel), "rate": rate}


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.savez("poses.npz", **lying_in(SIX))
    return "poses.npz"


def ups():
    return [word for up in SIX for word in ("--up", *map(str, up.tolist()))]


def estimator_of(path):
    file = load_robot_file(path)
    section = file.section("nodes")["imu_estimator"]
    return from_mapping(ImuEstimatorParameters, section, source=path, key="nodes.imu_estimator"), file


def test_the_written_robot_makes_the_imu_right(recorded, capsys):
    assert main(["calibrate-imu", recorded, *ups(), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert len(figures["poses"]) == 6 and not figures["notes"]
    assert "accel_calibration" not in figures["findings"]
    assert not any("negated" in sentence for sentence in figures["not_shown"])
    assert figures["norm_error_after_m_s2"] < 0.05 * figures["norm_error_before_m_s2"]

    parameters, file = estimator_of("article-calibrated.yaml")
    assert parameters.calibration.accel_scale == pytest.approx(SCALE, abs=1e-3)
    assert parameters.calibration.accel_offset == pytest.approx(OFFSET, abs=0.01)
    assert parameters.calibration.gyro_offset == pytest.approx(GYRO_OFFSET, abs=np.radians(0.01))
    assert file.robot.imu_mount.rpy == pytest.approx(MOUNT, abs=np.radians(0.1))
    # The calibrated estimator knows which way is down in every pose.
    trial = read_recording(recorded)
    for pose, up in enumerate(SIX):
        rows = slice(900 * pose, 900 * pose + 700)
        lying = Recording("pose", trial.stamp_ns[rows], trial.gyro[rows], trial.accel[rows])
        estimator = GravityEstimator(parameters.estimator, quat.from_roll_pitch_yaw(*file.robot.imu_mount.rpy))
        down = estimate_recording(lying, estimator).gravity[-1] / 9.81
        assert np.degrees(np.arccos(min(1.0, -down @ up))) < 0.2


def test_comments_and_the_rest_of_the_robot_stay(recorded):
    assert main(["calibrate-imu", recorded, "--write", "mine.yaml"]) == 0
    written, shipped = load_robot_file("mine.yaml"), load_robot_file("article")
    assert written.robot == shipped.robot
    assert written.section("hardware") == shipped.section("hardware")
    assert "# the board lies flat" in Path("mine.yaml").read_text(encoding="utf-8").replace("# imu_link in soft_base: ", "# ")


def test_one_pose_says_what_it_does_not_show(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    np.savez("flat.npz", **lying_in(SIX[:1]))
    assert main(["calibrate-imu", "flat.npz", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert figures["notes"] and any("--up in three poses" in sentence for sentence in figures["not_shown"])


def warming(monkeypatch):
    """A bag's recording of an IMU that rests while it warms from 20 to 35 degC, its bias rising by 0.015 deg/s a degree."""
    random = np.random.default_rng(2)
    stamp = np.arange(12000) * 10_000_000
    temperature = 35.0 - 15.0 * np.exp(-stamp * 1e-9 / 30.0)
    drift = np.radians(0.015) * (temperature - 20.0)
    recording = Recording(
        source="warming",
        stamp_ns=stamp,
        gyro=GYRO_OFFSET + drift[:, None] + random.normal(0, 0.002, (12000, 3)),
        accel=np.array([0, 0, 9.81]) + random.normal(0, 0.02, (12000, 3)),
        temperature_stamp_ns=stamp[::10],
        temperature=temperature[::10],
    )
    monkeypatch.setattr("gravcomp.recordings.imu.read_recording", lambda *_: recording)


def test_the_bias_over_temperature_is_learned_beyond_the_offset(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    warming(monkeypatch)
    assert main(["calibrate-imu", "bag", "--bias-model", "board.json"]) == 0
    parameters, _ = estimator_of("article-calibrated.yaml")
    assert parameters.bias_model_file == str(tmp_path / "board.json")
    model = BiasTemperatureModel.load(parameters.bias_model_file)
    for temperature in (24.0, 34.0):
        whole = np.degrees(model.bias(temperature) + parameters.calibration.gyro_offset)
        assert whole == pytest.approx(np.degrees(GYRO_OFFSET) + 0.015 * (temperature - 20.0), abs=0.03)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.npz"], "missing.npz: does not exist"),
        (["poses.npz", "--up", "0", "0", "1"], "has 6 distinct pose(s) at rest, but 1 direction(s)"),
        (["poses.npz", "--up", "0", "0", "0"], "other than zero"),
        (["poses.npz", "--bias-model", "b.json"], "contains no imu/temperature"),
        (["poses.npz", "--write", "nowhere/robot.yaml"], "cannot be written"),
        (["in_g.npz"], "in_g.npz: the accelerometer is in g (0.997 at rest): m/s^2 is needed; convert the recording"),
        (["negated.npz", *ups()], "negated.npz: the accelerometer is negated"),
        (["hand.npz"], "never rests"),
    ],
)
def test_what_cannot_be_used_is_one_sentence_and_code_2(recorded, capsys, arguments, words):
    trial = lying_in(SIX)
    np.savez("in_g.npz", **{**trial, "acc": trial["acc"] / 9.81})
    np.savez("negated.npz", **{**trial, "acc": -trial["acc"]})
    np.savez("hand.npz", **{**trial, "gyr": trial["gyr"] + np.random.default_rng(3).normal(0, 1.0, trial["gyr"].shape)})
    assert main(["calibrate-imu", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("gravcomp calibrate-imu: ") and words in error and error.count("\n") == 1
