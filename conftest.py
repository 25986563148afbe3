"""All tests: each worker process has a ROS domain of its own, so that tests side by side never hear each other's nodes."""

import os

import pytest


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Reserve the domain for what this process starts; one that the user has set stays."""
    if config.pluginmanager.has_plugin("dsession"):
        return  # it runs no test itself
    from gravcomp.launcher.domain import private_domain

    os.environ.update(private_domain())
