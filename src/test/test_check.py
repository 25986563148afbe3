"""The checks of `./gravcomp check`: lint, format and types of the whole source."""

from pathlib import Path

import pytest

from gravcomp.commands.__main__ import main
from gravcomp.commands.check import CHECKS, installed, run_check

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", CHECKS)
def test_the_source_passes(name):
    if not installed(CHECKS[name].tool):
        pytest.skip(f"{CHECKS[name].tool} is not installed")
    passed, text = run_check(ROOT, name)
    assert passed, text


def test_a_failing_check_is_reported_with_code_1(tmp_path, monkeypatch, capsys):
    if not installed("ruff"):
        pytest.skip("ruff is not installed")
    (tmp_path / "module.py").write_text("import os\n")
    monkeypatch.setenv("GRAVCOMP_ROOT", str(tmp_path))
    monkeypatch.setattr("gravcomp.environment.packages.provide_extra", lambda name: None)
    monkeypatch.delitem(CHECKS, "mypy")
    assert main(["check"]) == 1
    printed = capsys.readouterr()
    assert "ruff check: failed" in printed.out and "ruff format: passed" in printed.out
    assert "F401" in printed.err
