"""Tests that share what takes long to make run in one process."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def test_a_module_stays_in_one_process(request):
    """With some versions of pytest, pytest-xdist loses the groups without a word."""
    if not getattr(request.config.option, "loadgroup", False):
        pytest.skip("the tests run in one process, or are given by the user")
    assert request.node.nodeid.endswith("@test_scheduling")


def test_the_modules_that_begin_first_exist(request):
    conftest = request.config.pluginmanager.get_plugin(str(ROOT / "conftest.py"))
    assert all(any((ROOT / folder / f"{name}.py").exists() for folder in ("test", "src/test")) for name in conftest.FIRST)
