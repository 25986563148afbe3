"""What the campaigns watch and work the running graph with: the bus, and the node fault_probe."""

import json
import queue
import subprocess
import threading
import time
from dataclasses import dataclass

from gravcomp.canbus import codec
from gravcomp.canbus.link import CanLink
from gravcomp.launcher.virtual_graph import RunningGraph
from gravcomp.motors.state import State

_CURRENT_IDS = (0x200, 0x1FF)


@dataclass(frozen=True)
class StateSeen:
    """A change of cable/state; `time` (s, host) of its arrival."""

    time: float
    state: State
    message: str


class Probe:
    """The process fault_probe of a running graph."""

    def __init__(self, graph: RunningGraph):
        self._process = subprocess.Popen(
            graph.robot.node("gravcomp_hw", "fault_probe").module_command(),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip
        self.states: list[StateSeen] = []
        self._answers: queue.Queue[dict] = queue.Queue()
        threading.Thread(target=self._listen, name="probe", daemon=True).start()
        self._expect("ready", 30.0)

    def close(self) -> None:
        self._process.stdin.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def fault(self, **fault: object) -> None:
        """Inject into the virtual robot; without arguments, clear all."""
        self._order(do="fault", fault=fault or "clear")

    def call(self, service: str) -> dict:
        """A Trigger service's answer: sent (s, host), success, message."""
        self._order(do="call", service=service)
        return self._expect("answer", 5.0)

    def enable(self, on: bool) -> None:
        """Let the controller send commands, or not."""
        self._order(do="enable", on=on)
        if not self._expect("enabled", 15.0)["success"]:
            raise TimeoutError("the controller did not answer ~/enable")

    def command(self, displacement: list[float], count: int = 1) -> None:
        self._order(do="command", displacement=displacement, count=count)

    def match(self) -> bool:
        """Wait until faults and commands reach the robot and the bridge, and the bridge's state this probe, also after a new start."""
        self._order(do="match")
        return self._expect("matched", 15.0)["success"]

    def flood(self, messages: int) -> None:
        """Hostile messages to every input; returns when they are sent."""
        self._order(do="flood", messages=messages)
        self._expect("flooded", 60.0 + messages * 0.01)

    def count(self) -> dict:
        """commands: seen on cable/command since the start; bridge: its last diagnostic values."""
        self._order(do="count")
        return self._expect("count", 5.0)

    def displacement(self) -> list[float]:
        """m, of the cables, as measured."""
        self._order(do="displacement")
        return self._expect("displacement", 5.0)["displacement"]

    def state_at(self, time: float) -> State | None:
        """The last that was seen before `time` (s, host)."""
        return next((seen.state for seen in reversed(list(self.states)) if seen.time < time), None)

    def wait_for(self, states: set[State], since: float, timeout: float) -> StateSeen | None:
        """The first change to one of the states after `since` (s, host); None when there is none within `timeout`."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            found = next((seen for seen in list(self.states) if seen.time >= since and seen.state in states), None)
            if found:
                return found
            time.sleep(0.005)
        return None

    def _order(self, **order: object) -> None:
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()

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
        for line in self._process.stdout:
            try:
                content = json.loads(line)
            except ValueError:
                continue  # a log line
            if content["event"] == "state":
                self.states.append(StateSeen(content["time"], State(content["state"]), content["message"]))
            else:
                self._answers.put(content)


class CurrentMonitor:
    """A thread that looks at every motor current frame that anybody but this process sends.

    Attributes: frames, violations (frames with a current beyond `limit`, A), largest (A), traces (CommandTrace frames), last_sample
    (s, host: the last whole frame of the IMU's).
    """

    def __init__(self, graph: RunningGraph, limit: float):
        self.frames = self.violations = self.traces = 0
        self.largest = self.last_sample = 0.0
        self._trace_id, self._imu_id = (codec.layout(name).frame_id for name in ("CommandTrace", "ImuTime"))
        self.link = CanLink(graph.can, [*_CURRENT_IDS, self._trace_id, self._imu_id])
        self._limit = limit
        self._zero = dict.fromkeys(_CURRENT_IDS, True)
        self._changes: list[tuple[float, bool]] = []  # host time from which on all currents are zero, or are not
        self._last_trace = 0.0
        self._ending = threading.Event()
        self.link.open()
        self._thread = threading.Thread(target=self._watch, name="monitor", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ending.set()
        self._thread.join(2.0)
        self.link.close()

    def zero_since(self, since: float, timeout: float, lasting: float = 0.05) -> float | None:
        """Host time from which on all currents are zero for at least `lasting` s, not before `since`; None within `timeout`."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            last = self._changes[-1] if self._changes else (0.0, True)
            if last[1] and time.time() - max(last[0], since) >= lasting:
                return max(last[0], since)
            time.sleep(0.005)
        return None

    def trace_after(self, since: float, timeout: float) -> float | None:
        """Host time of a CommandTrace after `since`: commands are being followed."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            if self._last_trace > since:
                return self._last_trace
            time.sleep(0.005)
        return None

    def _watch(self) -> None:
        while not self._ending.is_set():
            for frame in self.link.receive(0.05):
                try:
                    values = codec.decode(frame).values
                except codec.FrameError:
                    continue
                if frame.arbitration_id == self._imu_id:
                    self.last_sample = frame.timestamp
                    continue
                if frame.arbitration_id == self._trace_id:
                    self.traces += 1
                    self._last_trace = frame.timestamp
                    continue
                largest = max(map(abs, values))
                self.frames += 1
                self.largest = max(self.largest, largest)
                self.violations += largest > self._limit
                before = all(self._zero.values())
                self._zero[frame.arbitration_id] = largest == 0.0
                after = all(self._zero.values())
                if before != after:
                    self._changes.append((frame.timestamp, after))
