"""The benchmarks' access to a running graph: the process gravcomp_hw.fault_probe."""

import json
import queue
import subprocess
import threading
import time
from dataclasses import dataclass
from typing import IO

from gravcomp.launcher.virtual_graph import RunningGraph
from gravcomp.motors.state import State


@dataclass(frozen=True)
class StateSeen:
    """A change of cable/state; `time` (s, host) of its arrival."""

    time: float
    state: State
    message: str


class Probe:
    """The process fault_probe of a running graph. Attribute states: the changes of cable/state since the start."""

    def __init__(self, graph: RunningGraph) -> None:
        self._process = subprocess.Popen(
            graph.robot.node("gravcomp_hw", "fault_probe").module_command(),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip
        assert self._process.stdin is not None and self._process.stdout is not None  # because they are pipes
        self._orders: IO[str] = self._process.stdin
        self._output: IO[str] = self._process.stdout
        self.states: list[StateSeen] = []
        self._answers: queue.Queue[dict] = queue.Queue()
        threading.Thread(target=self._listen, name="probe", daemon=True).start()
        self._expect("ready", 30.0)

    def close(self) -> None:
        """End the process."""
        self._orders.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def fault(self, **fault: object) -> None:
        """Inject a fault into the virtual robot; without arguments, clear all faults."""
        self._order(do="fault", fault=fault or "clear")

    def call(self, service: str) -> dict:
        """Call a Trigger service. Return its answer: sent (s, host), success, message. Raises TimeoutError."""
        self._order(do="call", service=service)
        return self._expect("answer", 5.0)

    def enable(self, on: bool) -> None:
        """Let the controller send commands, or not. Raises TimeoutError when it does not answer."""
        self._order(do="enable", on=on)
        if not self._expect("enabled", 15.0)["success"]:
            raise TimeoutError("the controller did not answer ~/enable")

    def command(self, displacement: list[float], count: int = 1) -> None:
        """Publish `count` commands with these displacements (m)."""
        self._order(do="command", displacement=displacement, count=count)

    def match(self) -> bool:
        """Wait until faults and commands reach robot and bridge, and the bridge's state this process, also after a restart."""
        self._order(do="match")
        return self._expect("matched", 15.0)["success"]

    def flood(self, messages: int) -> None:
        """Send hostile messages to every input. Returns when they are sent; raises TimeoutError."""
        self._order(do="flood", messages=messages)
        self._expect("flooded", 60.0 + messages * 0.01)

    def count(self) -> dict:
        """Return commands (received on cable/command since the start) and bridge (its last diagnostic values)."""
        self._order(do="count")
        return self._expect("count", 5.0)

    def displacement(self) -> list[float]:
        """Return the measured cable displacements (m)."""
        self._order(do="displacement")
        return self._expect("displacement", 5.0)["displacement"]

    def state_at(self, time: float) -> State | None:
        """Return the last state received before `time` (s, host), or None."""
        return next((seen.state for seen in reversed(list(self.states)) if seen.time < time), None)

    def wait_for(self, states: set[State], since: float, timeout: float) -> StateSeen | None:
        """Return the first change to one of the states after `since` (s, host); None after `timeout` (s)."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            found = next((seen for seen in list(self.states) if seen.time >= since and seen.state in states), None)
            if found:
                return found
            time.sleep(0.005)
        return None

    def _order(self, **order: object) -> None:
        self._orders.write(json.dumps(order) + "\n")
        self._orders.flush()

    def _expect(self, event: str, timeout: float) -> dict:
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            try:
                answer = self._answers.get(timeout=left)
            except queue.Empty:
                break
            if answer["event"] == event:
                return answer
        raise TimeoutError(f"fault_probe did not answer '{event}' within {timeout:.0f} s")

    def _listen(self) -> None:
        for line in self._output:
            try:
                content = json.loads(line)
            except ValueError:
                continue  # a log line
            if content["event"] == "state":
                self.states.append(StateSeen(content["time"], State(content["state"]), content["message"]))
            else:
                self._answers.put(content)
