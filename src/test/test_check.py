"""How `./gravcomp check` works, and what it does not find. `test/test_documented_lines.py` runs it over the whole source."""

import fcntl
import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from gravcomp.cache import cache_folder
from gravcomp.commands.__main__ import main
from gravcomp.commands.check import CHECKS, installed, run_check

ROOT = Path(__file__).resolve().parents[2]


def test_types_are_checked_without_what_another_command_installs():
    """mypy fails at an import that it does not find and pyproject.toml does not name; `check` installs nothing for pictures."""
    listed = {"gravcomp", "_typeshed", *sys.stdlib_module_names}
    for override in tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]["overrides"]:
        if override.get("ignore_missing_imports"):
            listed |= {name.split(".")[0] for name in override["module"]}
    locks = "".join((ROOT / f"requirements{kind}.lock").read_text(encoding="utf-8") for kind in ("", "-development"))
    distributions = packages_distributions()
    missed = []
    for path in (ROOT / "src/gravcomp").rglob("*.py"):
        for name in re.findall(r"^ *(?:from|import) (\w+)(?: import |\.| as |$)", path.read_text(encoding="utf-8"), re.MULTILINE):
            own = [re.sub(r"[._]", "-", found).lower() for found in distributions.get(name, ())]
            if name not in listed and not any(f"\n{found}==" in locks for found in own):
                missed.append(f"{path.relative_to(ROOT)}: {name}")
    assert not missed


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
