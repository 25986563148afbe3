"""The first and the second start in a new clone with empty caches, the start of the nodes, sizes and command times.

The clone, its home folder and its caches are temporary. A client of the page's WebSocket sees what a browser would receive: the
first tension of a cable, which comes with the first shape, stands for the moving page, the first delay from IMU to command for
the closed loop.
"""

import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median

from gravcomp.canbus.multicast import private_channel
from gravcomp.launcher.domain import reserve_domain

_SET_UP_PATIENCE = 1800.0  # s
_START_PATIENCE = 120.0  # s
_COMMAND_RUNS = 5
_NO_TEST = "set_up_only"  # no test has such a name: everything that tests need is provided, and none runs
_OURS = (
    "AMENT_", "CMAKE_", "COLCON_", "GRAVCOMP_", "NUMBA_", "OMP_", "OPENBLAS_", "MKL_", "PYTHON", "LD_LIBRARY", "UV_CACHE",
    "XDG_CACHE", "FASTRTPS_", "FASTDDS_", "ROS_AUTOMATIC", "VIRTUAL_ENV", "_ROS_WHEELS", "DISPLAY", "WAYLAND_",
)  # fmt: skip
_DOWNLOADED = re.compile(r"downloaded \d+ packages? in (?:(\d+)m )?([\d.]+)(ms|s)")
_ACTIVE = re.compile(r"All nodes are active after ([\d.]+) s")
_MOVING = re.compile(rb"border-radius:\.3em;width:\d")  # the bar of a cable's tension, from the first shape on
_CLOSED = re.compile(rb">[\d.]+ ms</div><div[^>]*>IMU to command")


def run(progress: Callable[[str], None], *, tests: bool = False) -> dict:
    """Return the figures of the start.

    first_page_s: from the clone to the moving page, without the downloads (download_s). later_page_s and later_loop_s: the second
    start until the page moves and until the loop is closed. nodes_active_s: from `up --virtual` starting its nodes until all are
    active, with warm caches. venv_mb: size of .venv as `du -sm` prints it. command_ms: start of two commands. test_s,
    test_fast_s: of `test` and `test --fast` after test_set_up_s, which brings what only tests need and compiles; tests_passed:
    whether both passed. All four are None without `tests`.
    """
    root = Path(os.environ["GRAVCOMP_ROOT"])
    with tempfile.TemporaryDirectory(prefix="gravcomp-start-") as scratch:
        clone, home = Path(scratch) / "clone", Path(scratch) / "home"
        home.mkdir()
        environment = _bare_environment(home)
        progress("first start: set-up, compilation, page")
        begin = time.monotonic()
        subprocess.run(["git", "clone", "--quiet", str(root), str(clone)], check=True, env=environment)
        first, output = _demo(clone, environment, begin, _SET_UP_PATIENCE)
        download = sum(_seconds(found) for found in _DOWNLOADED.finditer(output))
        progress("reduced model")
        subprocess.run([str(clone / "gravcomp"), "model", "build"], check=True, env=environment, capture_output=True)
        progress("second start")
        later, _ = _demo(clone, environment, time.monotonic(), _START_PATIENCE)
        progress("start of the nodes")
        active = median(_nodes_active(clone, environment) for _ in range(3))
        progress("start of the commands")
        figures = {
            "first_page_s": round(first["page"] - download, 1),
            "download_s": round(download, 1),
            "later_page_s": round(later["page"], 2),
            "later_loop_s": round(later["loop"], 2),
            "nodes_active_s": round(active, 2),
            "venv_mb": round(_size(clone / ".venv") / 2**20),
            "command_ms": {
                "version": round(1e3 * _command_time(clone, environment, "--version")),
                "model_help": round(1e3 * _command_time(clone, environment, "model", "--help")),
            },
            "test_set_up_s": None,
            "test_s": None,
            "test_fast_s": None,
            "tests_passed": None,
            "load_average": round(os.getloadavg()[0], 1),
        }
        if not tests:
            return {**figures, "note": "test_s and test_fast_s are measured with --tests"}
        progress("set-up of the tests")
        figures["test_set_up_s"], _ = _tests(clone, environment, "-k", _NO_TEST)
        progress("tests --fast")
        figures["test_fast_s"], fast_passed = _tests(clone, environment, "--fast")
        progress("tests")
        figures["test_s"], passed = _tests(clone, environment)
        figures["tests_passed"] = fast_passed and passed
    return figures


def _tests(clone: Path, environment: dict[str, str], *options: str) -> tuple[float, bool]:
    """Run `gravcomp test`; return its time (s) and whether all tests passed."""
    begin = time.monotonic()
    done = subprocess.run([str(clone / "gravcomp"), "test", *options], check=False, env=environment, capture_output=True)
    return round(time.monotonic() - begin, 1), done.returncode == 0


def _bare_environment(home: Path) -> dict[str, str]:
    """Return the environment of a new user: nothing of this command's environment, no caches."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(_OURS)}
    own = str(Path(sys.prefix) / "bin")
    path = ":".join(part for part in os.environ.get("PATH", "").split(":") if part != own)
    return {**kept, "PATH": path, "HOME": str(home), "ROS_DOMAIN_ID": reserve_domain()}


def _demo(clone: Path, environment: dict[str, str], begin: float, patience: float) -> tuple[dict[str, float], str]:
    """Run a demo until its loop is closed. Return the times since `begin` (s) of `page` and `loop`, and what it printed."""
    port = _free_port()
    log = clone.parent / "demo.log"
    command = [str(clone / "gravcomp"), "demo", "--no-open", "--duration", "60", "--port", str(port)]
    with open(log, "w", encoding="utf-8") as output:
        process = subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL, stdout=output, stderr=output)
    times: dict[str, float] = {}
    try:
        while time.monotonic() < begin + patience and process.poll() is None and len(times) < 2:
            for message in _messages(port):
                for name, pattern in (("page", _MOVING), ("loop", _CLOSED)):
                    if name not in times and pattern.search(message):
                        times[name] = time.monotonic() - begin
                if len(times) == 2:
                    break
            time.sleep(0.05)
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60.0)
    text = log.read_text(errors="replace", encoding="utf-8")
    if len(times) < 2:
        raise TimeoutError(f"the demo's loop was not closed within {patience:.0f} s; its last lines:\n{text[-1000:]}")
    return times, text


def _messages(port: int) -> Iterator[bytes]:
    """Yield what the page's server sends, until it ends or sends nothing for a second; nothing when there is no server."""
    import viser
    import zstandard
    from websockets.exceptions import WebSocketException
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    try:
        with connect(
            f"ws://127.0.0.1:{port}", subprotocols=[Subprotocol(f"viser-v{viser.__version__}")], max_size=None, open_timeout=2.0
        ) as socket_:
            while True:
                received = socket_.recv(timeout=1.0)
                message = received.encode() if isinstance(received, str) else bytes(received)
                start = message.find(b"\x28\xb5\x2f\xfd")  # a Zstandard frame, after viser's header
                if start >= 0:
                    message = zstandard.ZstdDecompressor().decompressobj().decompress(message[start:])
                yield message
    except (OSError, WebSocketException, TimeoutError):
        return


def _nodes_active(clone: Path, environment: dict[str, str]) -> float:
    """Return the seconds (s) that `up --virtual` takes from starting its nodes until all are active."""
    command = [str(clone / "gravcomp"), "up", "--virtual", "--channel", private_channel(), "--interface", "udp_multicast"]
    process = subprocess.Popen(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        for line in process.stdout or ():
            if found := _ACTIVE.search(line):
                return float(found.group(1))
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60.0)
    raise TimeoutError("the nodes did not become active")


def _command_time(clone: Path, environment: dict[str, str], *words: str) -> float:
    times = []
    for _ in range(_COMMAND_RUNS):
        begin = time.monotonic()
        subprocess.run([str(clone / "gravcomp"), *words], check=False, env=environment, capture_output=True)
        times.append(time.monotonic() - begin)
    return median(times)


def _size(folder: Path) -> int:
    """Return the size (bytes) of the files of a folder on the disk; files with several names count once."""
    found = {}
    for path in folder.rglob("*"):
        status = path.lstat()
        found[status.st_ino] = 512 * status.st_blocks
    return sum(found.values())


def _seconds(found: re.Match) -> float:
    minutes, number, unit = found.groups()
    return 60.0 * float(minutes or 0) + float(number) * (1e-3 if unit == "ms" else 1.0)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
