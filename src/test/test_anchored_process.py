"""The anchored model in a process of its own: what it answers, that nobody waits for it, and what happens when it dies."""

import dataclasses
import os
import pickle
import signal
import socket
import subprocess
import time

import numpy as np
import psutil
import pytest

from gravcomp.description import Elements, load_robot_file
from gravcomp.load_estimation import AnchoredModel, AnchoredProcess, AtOnce, anchored_process
from gravcomp.load_estimation.anchored_follower import Answer, Question
from gravcomp.load_estimation.message_pipe import framed
from gravcomp.simulation import RobotModel

pytestmark = pytest.mark.slow

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


def test_a_process_that_is_preempted_in_the_middle_of_an_answer_does_not_let_its_owner_wait(monkeypatch):
    other_ends = []

    def preempted(*_, pass_fds, **__):
        other_ends.append(socket.socket(fileno=os.dup(pass_fds[0])))
        return start(["sleep", "300"])

    start = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", preempted)
    worker = AnchoredProcess(ROBOT)
    (other,) = other_ends
    try:
        other.sendall(framed(None))
        wide = QUESTION._replace(wound=np.zeros(100_000))  # more than the connection takes
        assert worker.exchange(wide) == []
        with other.makefile("rb") as questions:
            pieces = b""
            while len(pieces) < len(pickle.dumps((0, wide))):  # the rest goes with later calls
                pieces += questions.read1()
                assert worker.exchange(QUESTION) == []
        asked, question = pickle.loads(pieces)
        answer = framed((asked, Answer(question._replace(wound=np.zeros(6)), None)))
        other.sendall(answer[:-1])
        assert worker.exchange(QUESTION) == []
        other.sendall(answer[-1:])
        (answer,) = worker.exchange(QUESTION)
        assert answer.found is None and answer.question.stamp == QUESTION.stamp
    finally:
        worker.close()
        other.close()
