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


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread the modules that run the graph evenly among the others, those with the longest timeout first.

    They mostly wait, the others compute: side by side they use the cores best, and several graphs at a time would slow each other
    down. The order within a module, and of the modules of each kind, stays that of pytest-randomly.
    """
    modules: dict[Path, list[pytest.Item]] = {}
    for item in items:
        modules.setdefault(item.path, []).append(item)
    folder = Path(__file__).parent / "test"
    graph = sorted((m for m in modules if m.parent == folder), key=lambda m: -max(map(_timeout, modules[m])))
    others = [m for m in modules if m.parent != folder]
    places = [((i + 0.5) / len(group), m) for group in (graph, others) for i, m in enumerate(group)]
    items[:] = [item for _, module in sorted(places, key=lambda place: place[0]) for item in modules[module]]


def _timeout(item: pytest.Item) -> float:
    mark = item.get_closest_marker("timeout")
    return mark.args[0] if mark else 0.0
