"""Tests that share what takes long to make run in one process."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def test_a_module_stays_in_one_process(request):
    """With some versions of pytest, pytest-xdist loses the groups without a word."""
    if not getattr(request.config.option, "loadgroup", False):
        pytest.skip("the tests run in one process, or are given by the user")
    assert request.node.nodeid.endswith("@test_scheduling")


@pytest.fixture
def conftest(request):
    return request.config.pluginmanager.get_plugin(str(ROOT / "conftest.py"))


def test_no_two_processes_rewrite_the_same_modules_at_the_same_time(conftest):
    modules = [Path(f"test_{k}.py") for k in range(147)]
    orders = [conftest._from_own_share(modules, number, 3) for number in range(3)]
    assert all(sorted(order) == sorted(modules) for order in orders)
    at_the_same_time = [set(moment) for moment in zip(*orders)]
    assert all(len(moment) == 3 for moment in at_the_same_time)
    # When a process comes to the share of another one, that has gone through it.
    assert orders[0][49] == orders[1][0] and orders[2][49] == orders[0][0]


def test_the_modules_that_begin_first_exist(conftest):
    assert all(any((ROOT / folder / f"{name}.py").exists() for folder in ("test", "src/test")) for name in conftest.FIRST)
