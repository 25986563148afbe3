"""The anchored model in a process of its own: what it answers, that nobody waits for it, and what happens when it dies."""

import dataclasses
import os
import signal
import subprocess
import time

import numpy as np
import psutil
import pytest

from gravcomp.description import Elements, load_robot_file
from gravcomp.load_estimation import AnchoredModel, AnchoredProcess, AtOnce, anchored_process
from gravcomp.load_estimation.anchored_follower import Question
from gravcomp.simulation import RobotModel

ROBOT = dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=4, along=4))
QUESTION = Question(0.0, np.array([0.0, 0.0, ROBOT.length]), np.array([-9.81, 0.0, 0.0]), np.zeros(6), ())


def until(found):
    """Wait for a value that counts as true, and return it."""
    end = time.monotonic() + 120.0
    while not (value := found()):
        assert time.monotonic() < end, "the process does not answer"
        time.sleep(0.005)
    return value


@pytest.fixture
def worker(monkeypatch):
    monkeypatch.setattr(anchored_process, "_PAUSE", 0.0)
    worker = AnchoredProcess(RobotModel(ROBOT).robot)
    yield worker
    worker.close()


def refused(*_, **__):
    raise OSError("no memory")


def test_a_process_answers_as_one_that_computes_at_once_and_is_replaced_when_it_dies(worker, monkeypatch):
    assert worker.exchange(QUESTION) == []  # it imports, and this process goes on
    (answer,) = until(lambda: worker.exchange(QUESTION))
    (same,) = AtOnce(AnchoredModel(RobotModel(ROBOT))).exchange(QUESTION)
    assert answer.question.stamp == QUESTION.stamp
    assert answer.found.carried == pytest.approx(same.found.carried, rel=1e-9) and answer.found.carried.any()
    first = psutil.Process(worker.pid)
    assert first.nice() == 19  # the nodes come first
    until(lambda: worker.exchange(QUESTION))
    worker.reset()
    worker.exchange(QUESTION)
    (again,) = until(lambda: worker.exchange(QUESTION))
    assert again.found.carried == pytest.approx(same.found.carried, rel=1e-9)  # from rest, not from its last shape
    os.kill(worker.pid, signal.SIGKILL)
    assert "exit code -9" in until(lambda: (worker.exchange(QUESTION), worker.sentence)[1])
    with monkeypatch.context() as full:
        full.setattr(subprocess, "Popen", refused)
        assert worker.exchange(QUESTION) == [] and "does not start: no memory" in worker.sentence
    assert until(lambda: worker.exchange(QUESTION)) and worker.sentence == ""
    second = psutil.Process(worker.pid)
    worker.close()
    assert not first.is_running() and not second.is_running()
