"""The checks of `./gravcomp check`: lint, format and types of the whole source."""

import fcntl
import re
import subprocess
from pathlib import Path

import pytest

from gravcomp.cache import cache_folder
from gravcomp.commands.__main__ import main
from gravcomp.commands.check import CHECKS, installed, run_check

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
@pytest.mark.parametrize("name", CHECKS)
def test_the_source_passes(name):
    if not installed(CHECKS[name].tool):
        pytest.skip(f"{CHECKS[name].tool} is not installed")
    passed, text = run_check(ROOT, name)
    assert passed, text


def test_text_is_read_and_written_with_a_declared_encoding():
    """Where Ruff's PLW1514 does not know that a value is a path: with LANG=C or on Windows the default is not UTF-8."""
    paths = [path for folder in ROOT.glob("gravcomp_*") for path in folder.rglob("*.py")]
    paths += [path for folder in ("src", "test") for path in (ROOT / folder).rglob("*.py")]
    found = []
    for path in paths:
        text = path.read_text(encoding="utf-8")
        for call in re.finditer(r"\.(read|write)_text\(", text):
            opened, end = 1, call.end()
            while opened:  # the bracket that closes the call
                opened += {"(": 1, ")": -1}.get(text[end], 0)
                end += 1
            if "encoding=" not in text[call.end() : end]:
                found.append(f"{path.relative_to(ROOT)}:{text.count(chr(10), 0, call.start()) + 1}")
    assert not found


def test_a_failing_check_is_reported_with_code_1(tmp_path, monkeypatch, capsys):
    if not installed("ruff"):
        pytest.skip("ruff is not installed")
    (tmp_path / "module.py").write_text("import os\n", encoding="utf-8")
    monkeypatch.setenv("GRAVCOMP_ROOT", str(tmp_path))
    monkeypatch.setattr("gravcomp.environment.packages.provide_extra", lambda name: None)
    monkeypatch.delitem(CHECKS, "mypy")
    assert main(["check"]) == 1
    printed = capsys.readouterr()
    assert "ruff check: failed" in printed.out and "ruff format: passed" in printed.out
    assert "F401" in printed.err


def test_types_that_were_checked_before_are_in_a_cache_that_one_run_uses_at_a_time(tmp_path, monkeypatch):
    commands = []

    def run(command: list[str], **options: object) -> subprocess.CompletedProcess:
        commands.append(command)
        with open(cache_folder("mypy") / "lock", "w", encoding="utf-8") as lock, pytest.raises(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return subprocess.CompletedProcess(command, 0, "")

    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))
    monkeypatch.setattr(subprocess, "run", run)
    for _ in range(2):
        assert run_check(ROOT, "mypy") == (True, "")
    assert [command[-2:] for command in commands] == [["--cache-dir", str(tmp_path / "mypy")]] * 2
