"""Set up every test process: one thread for linear algebra, and a ROS domain of its own.

With its own domain, a test does not hear the nodes of a test that runs at the same time.
"""

import os
from pathlib import Path

import pytest

# As the commands do, and before NumPy is imported: at these sizes more threads only wait for each other.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Reserve the domain for the processes that this one starts; a domain that the user has set stays."""
    if config.pluginmanager.has_plugin("dsession"):
        return  # the controlling process of pytest-xdist runs no test
    from gravcomp.launcher.domain import private_domain

    os.environ.update(private_domain())


@pytest.fixture(autouse=True)
def _own_priority():
    """Give up the priority that opening a bus takes: the next tests run in the same process."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    yield
    if os.getpriority(os.PRIO_PROCESS, 0) != before:
        os.setpriority(os.PRIO_PROCESS, 0, before)


def pytest_itemcollected(item: pytest.Item) -> None:
    """Run the tests of the graph one after the other, next to the others: two graphs on two cores miss their rates."""
    graph = item.path.parent == Path(__file__).parent / "test"
    item.add_marker(pytest.mark.xdist_group("graph" if graph else item.path.stem))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the tests of the graph, which take longest; otherwise keep the order of pytest-randomly."""
    items.sort(key=lambda item: item.path.parent != Path(__file__).parent / "test")
