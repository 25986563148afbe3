"""Tests that share what takes long to make run in one process."""

import pytest


def test_a_module_stays_in_one_process(request):
    """With some versions of pytest, pytest-xdist loses the groups without a word."""
    if not getattr(request.config.option, "loadgroup", False):
        pytest.skip("the tests run in one process, or are given by the user")
    assert request.node.nodeid.endswith("@test_scheduling")
