"""The process that starts nodes by forking: it imports once what the nodes share.

    python -m gravcomp.launcher.node_host SOCKET MODULES PADDING

SOCKET: number of the inherited socket to the launcher (`gravcomp.launcher.host_client`). MODULES: names of the modules to import,
with commas between them; MODULE:FUNCTION also calls a function. What fails is left to the node, which reports the error. PADDING:
room for the command lines of the nodes (`gravcomp.environment.process_title`).

A request and an answer are one line of JSON each:

    {"start": [EXECUTABLE, ARGUMENT, ...], "log": FILE, "environment": {...}}    launcher to host
    {"started": PID}  or  {"failed": TEXT}                                       answer to each request
    {"ended": PID, "code": CODE}                                                 for each node; negative: number of the signal

A node runs the file of its executable, as `ros2 run` does, in a session of its own. The host ends when the launcher closes its
end of the socket, and also when the launcher is killed. The kernel then sends SIGINT to the nodes that still run.
"""

import atexit
import contextlib
import gc
import importlib
import json
import os
import runpy
import selectors
import signal
import socket
import sys
import threading
import traceback
import warnings
from typing import NoReturn

from gravcomp.environment.end_with_parent import end_with_parent
from gravcomp.environment.process_title import set_title


def main(arguments: list[str]) -> int:
    """Import the modules and start nodes on request, until the launcher closes its end. Returns 0."""
    connection = socket.socket(fileno=int(arguments[0]))
    connection.set_inheritable(False)
    set_title("node_host", [sys.executable, "-m", "gravcomp.launcher.node_host"])
    for entry in filter(None, arguments[1].split(",")):
        name, _, function = entry.partition(":")
        with contextlib.suppress(Exception):
            module = importlib.import_module(name)
            if function:
                getattr(module, function)()
    if threading.active_count() != 1:
        # A lock that another thread holds at the moment of a fork would stay locked in the node.
        print(f"gravcomp: imports have started threads: {threading.enumerate()}", file=sys.stderr)
        return 1
    # The collector of a node does not visit what the host imported, which would copy all of it.
    gc.disable()
    gc.freeze()
    _Host(connection).serve()
    return 0


class _Host:
    def __init__(self, connection: socket.socket):
        self._connection = connection
        self._received = b""
        self._signals, self._wakeup = os.pipe2(os.O_CLOEXEC | os.O_NONBLOCK)

    def serve(self) -> None:
        """Handle requests and ends of nodes until the launcher closes its end."""
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.set_wakeup_fd(self._wakeup, warn_on_full_buffer=False)
        with selectors.DefaultSelector() as selector:
            self._selector = selector
            selector.register(self._connection, selectors.EVENT_READ)
            selector.register(self._signals, selectors.EVENT_READ)
            with contextlib.suppress(ConnectionError):
                while self._take_requests(selector.select()):
                    self._report_ends()

    def _take_requests(self, ready: list) -> bool:
        """Handle what has been received. Returns False when the launcher has closed its end."""
        for key, _ in ready:
            if key.fileobj is self._connection:
                chunk = self._connection.recv(65536)
                if not chunk:
                    return False
                self._received += chunk
            else:
                os.read(self._signals, 4096)
        while b"\n" in self._received:
            line, _, self._received = self._received.partition(b"\n")
            self._send(self._start(json.loads(line)))
        return True

    def _start(self, request: dict) -> dict:
        host = os.getpid()
        try:
            output = os.open(request["log"], os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        except OSError as error:
            return {"failed": str(error)}
        begun, beginning = os.pipe2(os.O_CLOEXEC)
        try:
            with warnings.catch_warnings():
                # Python counts the two threads of LTTng, which importing rclpy starts: they sleep until a tracing session begins.
                warnings.simplefilter("ignore", DeprecationWarning)
                pid = os.fork()
        except OSError as error:
            for descriptor in (output, begun, beginning):
                os.close(descriptor)
            return {"failed": f"no process can be started: {error}"}
        if pid:
            os.close(output)
            os.close(beginning)
            os.read(begun, 1)  # until its end is closed: a signal to the node's process group finds it from now on
            os.close(begun)
            return {"started": pid}
        self._selector.close()
        for descriptor in (self._connection.detach(), self._signals, self._wakeup, begun):
            os.close(descriptor)
        _become(request["start"], output, request["environment"], host, beginning)

    def _report_ends(self) -> None:
        with contextlib.suppress(ChildProcessError):
            while True:
                pid, status = os.waitpid(-1, os.WNOHANG)
                if not pid:
                    return
                self._send({"ended": pid, "code": os.waitstatus_to_exitcode(status)})

    def _send(self, answer: dict) -> None:
        self._connection.sendall(json.dumps(answer).encode() + b"\n")


def _become(command: list[str], output: int, environment: dict[str, str], host: int, beginning: int) -> NoReturn:
    """Turn the forked process into the node, and end with it."""
    code = 1
    try:
        os.setsid()
        end_with_parent(signal.SIGINT)
        if os.getppid() != host:  # it ended before
            os._exit(1)
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, ())
        os.close(beginning)
        gc.enable()
        nothing = os.open(os.devnull, os.O_RDONLY)
        for source, target in ((nothing, 0), (output, 1), (output, 2)):
            os.dup2(source, target)
        os.close(nothing)
        os.close(output)
        os.environ.update(environment)
        set_title(os.path.basename(command[0]), [sys.executable, *command])  # as the kernel names a script
        sys.argv = list(command)
        sys.path.insert(0, os.path.dirname(command[0]))  # as for a file that the interpreter runs
        code = _run(command[0])
    except KeyboardInterrupt:  # before the node began
        code = -signal.SIGINT
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        if code < 0:
            signal.signal(-code, signal.SIG_DFL)
            os.kill(os.getpid(), -code)
        # Without the destructors of the libraries: some belong to threads that only the host has.
        os._exit(code)


def _run(path: str) -> int:
    """Run a Python file as the interpreter does. Returns its exit code, or the negative number of the signal that ends it."""
    code = 0
    try:
        runpy.run_path(path, run_name="__main__")
    except SystemExit as end:
        if isinstance(end.code, int):
            code = end.code & 0xFF
        elif end.code is not None:
            print(end.code, file=sys.stderr)
            code = 1
    except KeyboardInterrupt:
        traceback.print_exc()
        code = -signal.SIGINT
    except BaseException:
        traceback.print_exc()
        code = 1
    threading._shutdown()  # type: ignore[attr-defined]  # waits for the threads of the node, as the interpreter does at its end
    atexit._run_exitfuncs()
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
