"""Fixtures of the tests that run the product as a user does: by its commands, as processes."""

import functools
import json
import os
import shutil
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from documents import documented
from shell import mirror, unless_stopped

from gravcomp.environment.give_way import give_way

ROOT = Path(__file__).resolve().parents[1]
WRITTEN_BY_LINES = ("src/README.md", "src/doc/figures.md")
EXAMPLES = ("src/examples/own_robot.yaml", "src/examples/joint_robot.yaml")


@dataclass
class Answer:
    """Exit code and output of a command."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict:
        return json.loads(self.out.strip().splitlines()[-1])


@pytest.fixture
def apart(request):
    """Return options of subprocess: a lower priority for the commands of tests that start no graph, which can run next to one."""
    if any(request.node.get_closest_marker(name) for name in ("graph", "rates", "nodes")):
        return {}
    return {"start_new_session": True, "preexec_fn": _give_way}


@pytest.fixture
def gravcomp(apart):
    """Run `./gravcomp ...` to its end."""

    def call(*arguments: str, timeout: float = 240.0, **environment: str) -> Answer:
        done = subprocess.run(
            [str(ROOT / "gravcomp"), *arguments],
            capture_output=True,
            text=True,
            timeout=timeout,
            env={**os.environ, **environment},
            **apart,
        )
        return Answer(done.returncode, done.stdout, done.stderr)

    return call


@pytest.fixture
def measured(gravcomp):
    """Run `./gravcomp ...`, which measures a graph, to its end; once more where a busy machine has stopped the graph."""

    def call(*arguments: str, timeout: float = 240.0, **environment: str) -> Answer:
        return unless_stopped(lambda: gravcomp(*arguments, timeout=timeout, **environment), lambda answer: answer.code)

    return call


@pytest.fixture
def gravcomp_process():
    """Start `./gravcomp ...` and return the running process; what still runs of it at the end is killed."""
    started = []

    def start(*arguments: str) -> subprocess.Popen:
        process = subprocess.Popen(
            [str(ROOT / "gravcomp"), *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=_react_to_sigint,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _react_to_sigint() -> None:
    """React to SIGINT: a process in the background of a shell ignores it, and the children of the tests would inherit that."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.fixture
def broad():
    """Return the folder with BROAD recordings: GRAVCOMP_DATA, else next to the repository; skip when neither exists."""
    folders = [Path(os.environ["GRAVCOMP_DATA"])] if "GRAVCOMP_DATA" in os.environ else [ROOT.parent / "shared" / "data"]
    for folder in [f for base in folders for f in (base / "broad", base)]:
        if sorted(folder.glob("*.npz")):
            return folder
    pytest.skip("no BROAD recordings: set GRAVCOMP_DATA to their folder")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder that looks like the repository to the reader; what is written into it does not reach the repository.

    The example robots have a coarse mesh there, with which a line takes a part of its time.
    """
    folder = tmp_path_factory.mktemp("repository")
    mirror(ROOT, folder, [Path(path) for path in (*WRITTEN_BY_LINES, *EXAMPLES)] + [Path("src/doc/pictures/none")])
    for name in EXAMPLES:
        described, fine = (folder / name).read_text(encoding="utf-8"), "elements: {around: 8, along: 12}"
        assert fine in described
        (folder / name).write_text(described.replace(fine, "elements: {around: 4, along: 6}"), encoding="utf-8")
    for name in ("ROBOT", "my_robot", "left", "right", "robot"):
        shutil.copy(ROOT / "src/gravcomp/robots/article.yaml", folder / f"{name}.yaml")
    return folder


@pytest.fixture
def type_in(folder, apart):
    """Return a function that types a documented line followed by `shorter`, and returns exit code and output."""

    def run(line: str, shorter: str = "", timeout: float = 600.0, **given: object) -> tuple[int, str]:
        done = subprocess.run(
            [*documented(line, **given), *shorter.split()],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=timeout,
            **apart,
        )
        return done.returncode, done.stdout

    return run


@pytest.fixture(scope="module")
def recording():
    """An IMU stream with ground truth: one of BROAD; the bag in the repository has no ground truth."""
    from gravcomp.recordings.imu.broad_folder import WHERE, broad_files

    files = broad_files()
    if not files:
        pytest.skip(f"no recordings with ground truth. {WHERE}")
    return files[0]


@pytest.fixture(scope="module")
def made(folder):
    """Return a function that runs a command with --brief; lines that differ only in the document they write to run once.

    low: with lower priority.
    """

    @functools.cache
    def run(words: tuple[str, ...], low: bool) -> tuple[int, str]:
        def once() -> subprocess.CompletedProcess:
            return subprocess.run(
                [*words, "--brief"],
                cwd=folder,
                capture_output=True,
                text=True,
                timeout=1500,
                start_new_session=True,
                preexec_fn=_give_way if low else None,
            )

        done = unless_stopped(once, lambda done: done.returncode)
        return done.returncode, done.stderr + done.stdout

    def made(line: str, low: bool) -> tuple[int, str]:
        words = (word for word in documented(line) if word not in ("--brief", "--write") and not word.endswith(".md"))
        return run(tuple(words), low)

    return made


def _give_way() -> None:
    give_way(10)
