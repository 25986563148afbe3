"""The node host: processes forked from one that has imported what they share, with executables that need no ROS."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from gravcomp.launcher.graph import Graph, NodeDied
from gravcomp.launcher.host_client import MARK, HostError, NodeHost, is_alive, runs_in_host
from gravcomp.launcher.node_process import NodeSpec

REPORT = """
import json, os, signal, sys, threading
signals = {n: signal.getsignal(getattr(signal, n)) is h for n, h in
    dict(SIGINT=signal.default_int_handler, SIGTERM=signal.SIG_DFL, SIGCHLD=signal.SIG_DFL).items()}
print(json.dumps(dict(
    argv=sys.argv, name=__name__, path=sys.path[0], session=os.getsid(0), pid=os.getpid(), signals=signals, mask=len(
    signal.pthread_sigmask(signal.SIG_BLOCK, ())), threads=threading.active_count(), loaded="xml.dom" in sys.modules,
    value=os.environ.get("VALUE"), files=sorted(os.listdir("/proc/self/fd"), key=int), frozen=__import__("gc").isenabled())))
"""
WAIT = "import time\nprint('ready', flush=True)\ntime.sleep(60)\n"
ON_INTERRUPT = """
import time
try:
    print("ready", flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    print("zero")
"""


def until(condition, timeout: float = 20.0):
    end = time.monotonic() + timeout
    while not (found := condition()):
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.01)
    return found


@pytest.fixture(scope="module")
def shared_host():
    """A host for the tests that do not end it."""
    with NodeHost(["xml.dom", "a_module_that_is_not_there"]) as host:
        yield host


@pytest.fixture
def own_host():
    with NodeHost([]) as host:
        yield host


@pytest.fixture
def executable(tmp_path, monkeypatch):
    """Return a function that installs a Python executable in a package, as colcon does, and returns its path."""
    package = tmp_path / "prefix" / "lib" / "tiny"
    package.mkdir(parents=True)
    index = tmp_path / "prefix" / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    (index / "tiny").touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "prefix"))

    def install(text: str, name: str = "node", interpreter: str = sys.executable) -> Path:
        path = package / name
        path.write_text(f"#!{interpreter}\n{text}", encoding="utf-8")
        path.chmod(0o755)
        return path

    return install


def run(host: NodeHost, path: Path, *arguments: str) -> tuple[int, str]:
    """Run an executable to its end. Return its exit code and its output."""
    log = path.with_suffix(".log")
    pid = host.start([str(path), *arguments], log, {})
    return until(lambda: host.exit_code(pid) is not None and (host.exit_code(pid), log.read_text(encoding="utf-8")))


def test_a_node_finds_itself_as_in_a_process_of_its_own(shared_host, executable, tmp_path):
    path = executable(REPORT)
    pid = shared_host.start([str(path), "--ros-args", "-p", "a:=1"], tmp_path / "log", {"VALUE": "7"})
    assert until(lambda: shared_host.exit_code(pid) is not None) and shared_host.exit_code(pid) == 0
    found = json.loads((tmp_path / "log").read_text(encoding="utf-8"))
    assert found["argv"] == [str(path), "--ros-args", "-p", "a:=1"]
    assert (found["name"], found["path"], found["value"]) == ("__main__", str(path.parent), "7")
    assert found["pid"] == found["session"] == pid
    assert all(found["signals"].values()) and found["mask"] == 0 and found["threads"] == 1 and found["frozen"]
    assert found["loaded"]
    # stdin, stdout, stderr and the folder that the node lists.
    assert found["files"][:3] == ["0", "1", "2"] and len(found["files"]) == 4


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        ("pass", 0, ""),
        ("import sys; sys.exit(3)", 3, ""),
        ("import sys; sys.exit('bad file')", 1, "bad file"),
        ("raise ValueError('wrong')", 1, "ValueError: wrong"),
        ("import os; os.kill(os.getpid(), 15)", -signal.SIGTERM, ""),
        ("import os; os.kill(os.getpid(), 2); import time; time.sleep(9)", -signal.SIGINT, "KeyboardInterrupt"),
        ("import atexit; atexit.register(print, 'the end')", 0, "the end"),
        ("import threading, time; threading.Thread(target=lambda: (time.sleep(0.1), print('late'))).start()", 0, "late"),
    ],
)  # fmt: skip
def test_a_node_ends_as_the_interpreter_ends(shared_host, executable, text, code, words):
    path = executable(text)
    ended, output = run(shared_host, path)
    interruptible = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)  # noqa: E731 (a background job ignores SIGINT)
    apart = subprocess.run([str(path)], capture_output=True, text=True, check=False, preexec_fn=interruptible)
    assert ended == apart.returncode == code
    assert words in output and words in apart.stdout + apart.stderr


def test_a_node_that_is_interrupted_before_it_begins_ends_without_a_traceback():
    """Until it has its own output, the terminal of the command would show it."""
    interrupted = """
import os, signal
from gravcomp.launcher.node_host import _become
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
os.kill(os.getpid(), signal.SIGINT)
_become(["/node"], os.open(os.devnull, os.O_WRONLY), {}, os.getppid(), os.pipe()[1])
"""
    done = subprocess.run([sys.executable, "-c", interrupted], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "")


def test_the_command_line_and_the_mark_of_a_node_are_visible(shared_host, executable, tmp_path):
    path = executable(WAIT, "long_wait")
    pid = shared_host.start([str(path), "-p", "a:=1"], tmp_path / "log", {})
    until(lambda: "ready" in (tmp_path / "log").read_text(encoding="utf-8"))
    words = Path(f"/proc/{pid}/cmdline").read_bytes().rstrip(b"\0").split(b"\0")
    assert [word.decode() for word in words[1:]] == [str(path), "-p", "a:=1"]
    assert psutil.Process(pid).name() == "long_wait"
    assert f"{MARK}={shared_host.mark}".encode() in Path(f"/proc/{pid}/environ").read_bytes()
    os.kill(pid, signal.SIGKILL)
    until(lambda: shared_host.exit_code(pid) == -signal.SIGKILL)


def test_the_nodes_of_a_killed_host_get_sigint_and_are_named(own_host, executable, tmp_path):
    executable(ON_INTERRUPT)
    with Graph([NodeSpec("tiny", "node")], tmp_path, host=own_host) as graph:
        graph.start()
        process = graph.processes["node"]
        until(lambda: "ready" in process.log.read_text(encoding="utf-8"))
        os.kill(own_host.pid, signal.SIGKILL)
        until(graph.dead)
        with pytest.raises(NodeDied, match=r"node ended with the node host \(process \d+\), which was ended by SIGKILL"):
            graph.check()
        until(lambda: process.has_ended)
        assert "zero" in process.log.read_text(encoding="utf-8")
        with pytest.raises(HostError, match="SIGKILL"):
            own_host.start(["node"], tmp_path / "log", {})


def test_a_graph_starts_watches_and_ends_the_nodes_of_a_host(own_host, executable, tmp_path):
    executable(WAIT, "first")
    executable("print('second: no bus'); raise SystemExit(2)", "second")
    executable("#!/bin/sh\nsleep 60", "third", "/bin/sh")
    with Graph([NodeSpec("tiny", name) for name in ("first", "second", "third")], tmp_path, host=own_host) as graph:
        graph.start()
        parents = {name: psutil.Process(process.pid).ppid() for name, process in graph.processes.items() if name != "second"}
        assert parents == {"first": own_host.pid, "third": os.getpid()}
        assert until(graph.dead) == {"second": "ended with code 2: no bus"}
        graph.start_one(NodeSpec("tiny", "first"))  # once more
    assert {process.why() for process in graph.processes.values()} >= {"ended with code 2: no bus"}
    assert not any(is_alive(process.pid) for process in graph.processes.values()) and not is_alive(own_host.pid)


def test_the_nodes_of_a_killed_launcher_end(executable, tmp_path):
    path = executable(WAIT)
    launcher = (
        "import sys, time; from pathlib import Path; from gravcomp.launcher.host_client import NodeHost; host = NodeHost([]); "
        "print(host.pid, host.start([sys.argv[1]], Path(sys.argv[2]), {}), flush=True); time.sleep(60)"
    )
    process = subprocess.Popen([sys.executable, "-c", launcher, path, tmp_path / "log"], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    pids = [int(word) for word in process.stdout.readline().split()]
    os.kill(pids[0], signal.SIGSTOP)  # even then
    process.kill()
    process.communicate()
    until(lambda: not any(is_alive(pid) for pid in pids))


def test_only_python_files_of_this_environment_run_in_a_host(executable, tmp_path):
    assert runs_in_host(str(executable("")))
    assert not runs_in_host(str(executable("", interpreter="/bin/sh")))
    assert not runs_in_host(str(executable("", interpreter="/usr/bin/env python3")))
    assert not runs_in_host(str(executable("", interpreter=str(tmp_path / "bin" / "python3"))))
    assert not runs_in_host("/bin/true")
