"""Helpers for tests that run the product as its users do: by its commands, as processes."""

import json
import os
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@dataclass
class Answer:
    """What a command gave."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict:
        return json.loads(self.out.strip().splitlines()[-1])


@pytest.fixture
def gravcomp():
    """Run `./gravcomp ...` to its end."""

    def call(*arguments: str, timeout: float = 240.0, **environment: str) -> Answer:
        done = subprocess.run(
            [str(ROOT / "gravcomp"), *arguments],
            capture_output=True,
            text=True,
            timeout=timeout,
            env={**os.environ, **environment},
        )
        return Answer(done.returncode, done.stdout, done.stderr)

    return call


@pytest.fixture
def gravcomp_process():
    """Start `./gravcomp ...` and hand over the running process; whatever is left of it at the end is killed."""
    started = []

    def start(*arguments: str) -> subprocess.Popen:
        process = subprocess.Popen(
            [str(ROOT / "gravcomp"), *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=_heed_ctrl_c,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _heed_ctrl_c() -> None:
    """A shell starts what runs in its background deaf to SIGINT, and the tests' children would inherit that."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.fixture
def broad():
    """The folder with BROAD recordings: GRAVCOMP_DATA, else beside the repository; skipped when neither is there."""
    folders = [Path(os.environ["GRAVCOMP_DATA"])] if "GRAVCOMP_DATA" in os.environ else [ROOT.parent / "shared" / "data"]
    for folder in [f for base in folders for f in (base / "broad", base)]:
        if sorted(folder.glob("*.npz")):
            return folder
    pytest.skip("no BROAD recordings: set GRAVCOMP_DATA to their folder")
