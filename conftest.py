"""Set up every test process: one thread for linear algebra, a ROS domain of its own, and the order of the tests.

With its own domain, a test does not hear the nodes of a test that runs at the same time.

Marks of the tests that start a graph of nodes, which is slow where others take its processors, or single nodes:

    graph    it waits for events: another such test may run next to it where there are processors for two graphs
    rates    it asserts rates or delays: no other test with these two marks runs meanwhile
    nodes    its nodes take little of a processor, as no virtual robot drives them: it runs next to a graph

The mark `slow` leaves a test in src/test out of `./gravcomp test --fast`, as it is no unit test of the core (CONTRIBUTING.md).

All tests with the mark `rates` run in one process, one after the other. They begin first; next to them run tests without a graph,
those that take longest first. With fewer than four processors the tests with the mark `graph` follow in the same process. A test
of the commands in test/ without a mark starts no graph, or one for seconds only.
"""

import contextlib
import fcntl
import importlib
import os
import sys
import tempfile
from importlib.util import cache_from_source
from pathlib import Path

import pytest

# As the commands do, and before NumPy is imported: at these sizes more threads only wait for each other.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

_COMMANDS = Path(__file__).parent / "test"
_SHARING = {"rates": fcntl.LOCK_EX, "graph": fcntl.LOCK_SH}
_MARKS = (*_SHARING, "nodes")
# A graph takes up to 0.9 of a processor: next to the other tests two of them starve on two.
_ONE_GRAPH = (os.cpu_count() or 1) < 4
# Modules that begin first among their kind, in this order: those that take longest. pytest-xdist gives a process that has at most
# two tests left its next module at once, so a short one comes behind each that has a single long test.
FIRST = (
    "test_documented_firmware",
    "test_documented_experiments",
    "test_docs",
    "test_documented_benchmarks",
    "test_bad_input",
    "test_documents",
    "test_arm_command",
    "test_demo",
    "test_documented_nodes",
    "test_documented_lines",
    "test_colcon_workspace",
    "test_record_replay",
    "test_targets",
    "test_board_client",
    "test_contact",
    "test_reduction",
    "test_calibrate_command",
    "test_swept_bodies",
    "test_statics",
    "test_inverse_recovery",
    "test_bridge",
    "test_bridge_driver",
    "test_late_reduction",
    "test_inverse",
)
_OF_A_TERMINAL = ("COLUMNS", "LINES", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE")  # they wrap and colour output
_LOCK = "GRAVCOMP_TEST_LOCK"  # environment variable with the file that the processes of a run lock


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Declare the marks, and reserve the domain for the processes that this one starts; a domain that the user has set stays."""
    config.addinivalue_line("markers", "graph: starts nodes; may run next to another graph")
    config.addinivalue_line("markers", "rates: asserts rates or delays of a graph; no other graph runs meanwhile")
    config.addinivalue_line("markers", "nodes: starts nodes that take little of a processor; runs next to a graph")
    config.addinivalue_line("markers", "slow: no unit test of the core; left out of ./gravcomp test --fast")
    if config.pluginmanager.has_plugin("dsession"):  # the controlling process of pytest-xdist, which runs no test
        handle, name = tempfile.mkstemp(prefix="gravcomp-tests-")
        os.close(handle)
        os.environ[_LOCK] = name
        config.add_cleanup(Path(name).unlink)
        return
    from gravcomp.launcher.domain import private_domain

    os.environ.update(private_domain())
    for name in _OF_A_TERMINAL:
        os.environ.pop(name, None)


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session: pytest.Session) -> None:
    """Import the test modules, each process in another order, where some of them have to be rewritten.

    pytest rewrites the assertions of each test module that has changed, which takes twice as long as the rest of a collection,
    and keeps the result. In a new clone all processes would rewrite the same modules at the same time. So each begins with other
    modules, and finds later those that the others have rewritten.
    """
    config = session.config
    if not hasattr(config, "workerinput") or sys.dont_write_bytecode:
        return
    modules = _modules(config)
    if all(_is_rewritten(module) for module in modules):
        return
    number, count = int(config.workerinput["workerid"].removeprefix("gw")), config.workerinput["workercount"]
    for module in _from_own_share(modules, number, count):
        _import(module)


def _modules(config: pytest.Config) -> list[Path]:
    """Return the test modules in the folders of this run."""
    return [path for folder in config.args for path in sorted((config.invocation_params.dir / folder).glob("test_*.py"))]


def _from_own_share(modules: list[Path], number: int, count: int) -> list[Path]:
    """Return the modules from the first of the share of process `number` of `count`, to the last one before it."""
    first = number * len(modules) // count
    return modules[first:] + modules[:first]


def _is_rewritten(module: Path) -> bool:
    """Return whether pytest has rewritten a module as it is."""
    kind = f"{sys.implementation.cache_tag}-pytest-{pytest.__version__}.pyc"
    rewritten = Path(cache_from_source(str(module))).with_name(f"{module.stem}.{kind}")
    return rewritten.exists() and rewritten.stat().st_mtime >= module.stat().st_mtime


def _import(module: Path) -> None:
    """Import a test module as the collection does, which finds it then; one that cannot be imported is reported there."""
    if str(module.parent) not in sys.path:
        sys.path.insert(0, str(module.parent))
    with contextlib.suppress(Exception, pytest.skip.Exception):
        importlib.import_module(module.stem)


@pytest.fixture(autouse=True)
def _own_priority():
    """Give up the priority that opening a bus takes: the next tests run in the same process."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    yield
    if os.getpriority(os.PRIO_PROCESS, 0) != before:
        os.setpriority(os.PRIO_PROCESS, 0, before)


@pytest.fixture(autouse=True)
def _own_output():
    """Forget --json and --quiet of a command that a test has run in this process: the next test reads the notes."""
    yield
    if "gravcomp.commands.output" in sys.modules:
        sys.modules["gravcomp.commands.output"].configure(json=False, quiet=False)


def _mark(item: pytest.Item) -> str:
    """Return 'rates', 'graph', 'nodes' or ''; a mark of the test goes before that of its module."""
    return next((mark.name for mark in item.iter_markers() if mark.name in _MARKS), "")


def _group(item: pytest.Item) -> str:
    """Return the name of the tests that run in one process, one after the other: those of a module, which share its fixtures."""
    mark = _mark(item)
    alone = mark == "rates" or (mark == "graph" and _ONE_GRAPH)
    return "rates" if alone else f"{item.path.stem}-{mark}".strip("-")


def pytest_itemcollected(item: pytest.Item) -> None:
    """Tell pytest-xdist which tests belong together."""
    item.add_marker(pytest.mark.xdist_group(_group(item)))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put what takes longest first, so that no process is idle at the end; otherwise keep the order of pytest-randomly.

    Rates; commands without a graph, which run next to them; other graphs, and nodes; unit tests. Long modules come first.
    """

    def rank(item: pytest.Item) -> tuple[int, int]:
        kind = {"rates": 0, "": 1 if item.path.parent == _COMMANDS else 3, "graph": 2, "nodes": 2}[_mark(item)]
        return kind, FIRST.index(item.path.stem) if item.path.stem in FIRST else len(FIRST)

    items.sort(key=rank)


_held: list[int] = []  # descriptor of the lock while a group runs that needs it


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None):
    """Wait until the graphs of the other processes allow this one, from a group's first test to the end of its fixtures."""
    if not _held and _mark(item) in _SHARING and _LOCK in os.environ:
        _held.append(os.open(os.environ[_LOCK], os.O_RDONLY | os.O_CLOEXEC))
        fcntl.flock(_held[0], _SHARING[_mark(item)])
    try:
        return (yield)
    finally:
        if _held and (nextitem is None or _group(nextitem) != _group(item)):
            os.close(_held.pop())
