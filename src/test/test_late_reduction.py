"""A simulator that starts on the full model changes over to the reduced model when that is built."""

import dataclasses
import errno
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from coarse_article import built_once, cache_of_the_run, coarse, keep_compiled

from gravcomp.description import load_robot_file
from gravcomp.description.robot import Robot
from gravcomp.launcher import model_builder
from gravcomp.mesh import tube_mesh
from gravcomp.reduction import load, path_of
from gravcomp.simulation import DynamicSimulator, RobotModel, Simulator
from gravcomp.simulation.late_reduction import LateReduction
from gravcomp.training import TrainingOptions
from gravcomp.training.samples import samples

GRAVITY = 9.81 * np.array([0.0, np.sin(0.4), np.cos(0.4)])


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    """The file of the robot's reduced model."""
    with cache_of_the_run(tmp_path_factory):
        model, _ = built_once(coarse())
        return path_of(model)


@pytest.fixture
def robot(tmp_path, monkeypatch) -> Robot:
    """The robot, and a cache without its reduced model."""
    keep_compiled(tmp_path)
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))
    return coarse()


def store(robot: Robot, built: Path) -> Path:
    """Put the reduced model into the cache at once, as a builder does at its end; returns its path."""
    path = path_of(RobotModel(robot))
    shutil.copy(built, path.with_suffix(".part"))
    return path.with_suffix(".part").replace(path)


def exchanged(late: LateReduction, patience: float = 60.0) -> bool:
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if late.exchange():
            return True
        time.sleep(0.02)
    return False


@pytest.mark.parametrize("kind", [Simulator, DynamicSimulator])
def test_the_tip_does_not_jump_when_the_reduced_model_takes_over(robot, built, kind):
    simulator = kind(robot)
    late = LateReduction(simulator, period=0.02)
    wound = np.zeros(len(robot.cables))
    for share in np.linspace(0.0, 1.0, 20):
        before = simulator.step(share * GRAVITY, wound)
    assert before.model == "full" and late.missing
    if kind is DynamicSimulator:
        before = simulator.settle(GRAVITY, wound)
    store(robot, built)
    assert exchanged(late)
    tips, models = [before.tip_position], []
    for _ in range(3):
        shape = simulator.step(GRAVITY, wound)
        tips.append(shape.tip_position)
        models.append(shape.model)
    assert models[-1] == "reduced"
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1).max() < 1e-4  # 0.1 mm of 100
    late.stop()


def test_there_is_nothing_to_wait_for_where_the_reduced_model_serves_or_cannot(robot):
    linear = RobotModel(robot, tube_mesh(robot, "tet4"))
    assert not LateReduction(Simulator(linear)).missing


def test_an_interrupted_training_goes_on_and_finds_the_same_samples(robot, tmp_path):
    model, options = RobotModel(robot), TrainingOptions(paths=4, steps=3)
    whole = samples(model, options)

    class Interrupted(Exception):
        pass

    def interrupt(share: float) -> None:
        if share == 0.5:
            raise Interrupted

    with pytest.raises(Interrupted):
        samples(model, options, interrupt, tmp_path / "kept")
    done = sorted((tmp_path / "kept").iterdir())
    assert len(done) == 2
    stamps = [path.stat().st_mtime_ns for path in done]
    again = samples(model, options, kept=tmp_path / "kept")
    assert [path.stat().st_mtime_ns for path in done] == stamps
    assert len(again) == len(whole)
    for one, other in zip(whole, again):
        np.testing.assert_array_equal(one.unknowns, other.unknowns)


def test_the_training_ends_once_new_paths_are_represented(robot):
    stiff = robot.with_material(youngs_modulus=20e6)  # no path needs steps to its first shape
    model, options = RobotModel(stiff), TrainingOptions(paths=14, least=11, steps=1)
    asked = []

    def enough(earlier: list, new: list) -> bool:
        asked.append((len(earlier), len(new)))
        return True

    found = samples(model, options, enough=enough)
    assert asked == [(1, 10)] and len(found) == 11
    assert len(samples(model, dataclasses.replace(options, paths=12), enough=lambda earlier, new: False)) == 12


def test_a_robot_without_cables_has_samples():
    bare = dataclasses.replace(coarse(), cables=())
    assert len(samples(RobotModel(bare), TrainingOptions(paths=4, steps=1))) == 4


def test_a_second_builder_finds_the_model_of_the_first(robot, built, tmp_path):
    shipped = Path(load_robot_file("article").source).read_text(encoding="utf-8")
    described = re.sub(r"(?m)^  elements: .*$", "  elements: {around: 4, along: 4}", shipped)
    (tmp_path / "robot.yaml").write_text(described, encoding="utf-8")
    assert load_robot_file(str(tmp_path / "robot.yaml")).robot == robot
    stamp = store(robot, built).stat().st_mtime_ns
    command = [sys.executable, "-m", "gravcomp.training.background", str(tmp_path / "robot.yaml")]
    done = subprocess.run(command, env=dict(os.environ), capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and not done.stderr
    path = path_of(RobotModel(robot))
    assert path.stat().st_mtime_ns == stamp and done.stdout == f"{stamp} {path}\n"
    assert load(RobotModel(robot)) is not None


def test_no_builder_is_started_for_a_model_that_is_known_to_be_stored(tmp_path, monkeypatch):
    file, robot, other, started = tmp_path / "model.npz", tmp_path / "robot.yaml", tmp_path / "other.yaml", []
    file.touch()
    robot.write_text(Path(load_robot_file("article").source).read_text(encoding="utf-8"), encoding="utf-8")
    other.write_text(robot.read_text(encoding="utf-8").replace("grading: 16.0", "grading: 8.0"), encoding="utf-8")

    def start(name: str, output: int) -> subprocess.Popen:
        line = f"{file.stat().st_mtime_ns} {file}"
        started.append(subprocess.Popen([sys.executable, "-c", f"print({line!r})"], stdout=output, text=True))
        started[-1].wait()
        return started[-1]

    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(model_builder, "start_builder", start)
    for path, count in ((robot, 1), (robot, 1), (other, 2), (other, 2)):
        with model_builder.ModelBuilder(str(path)) as builder:
            builder.start()
        assert len(started) == count
    os.utime(file, ns=(0, 0))  # written again, for other moduli
    with model_builder.ModelBuilder(str(robot)) as builder:
        builder.start()
    assert len(started) == 3
    os.utime(file, ns=(2, 2))
    model_builder.note_stored(str(robot), file)  # as `gravcomp model build` does, which has found or built it
    with model_builder.ModelBuilder(str(robot)) as builder:
        builder.start()
    assert len(started) == 3

    def full(path: Path, content: str) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(model_builder, "write_whole", full)
    os.utime(file, ns=(1, 1))
    with model_builder.ModelBuilder(str(robot)) as builder:  # the command that it serves does not end with an error
        builder.start()
