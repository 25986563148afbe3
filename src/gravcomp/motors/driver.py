"""The thread that runs the bridge on its buses: it receives, controls and sends, independently of the rest of the process.

    bus --frames--> Bridge (states, loops) --currents--> bus          every control period
        --frames--> ImuStream --samples--> queue                      as they come
    command() --> Bridge --currents--> bus                            immediately, not at the next period

IMU samples and cable states for the caller go into a queue that the thread never waits for: a caller that hangs loses the oldest
entries, and the control goes on.
"""

import collections
import contextlib
import dataclasses
import queue
import sys
import threading
import time
from collections.abc import Callable, Sequence

import can

from gravcomp.canbus import c610, codec
from gravcomp.canbus.buses import CanBuses
from gravcomp.canbus.imu_stream import IMU_FRAMES, ImuSample, ImuStream
from gravcomp.canbus.link import lateness
from gravcomp.canbus.precedence import take_precedence
from gravcomp.description.hardware import MOTOR_IDS, Hardware
from gravcomp.motors.bridge import Bridge
from gravcomp.motors.guard_client import GuardClient
from gravcomp.motors.state import CableSnapshot, State, ZeroRecord, record_key, record_of_bus

RECEIVED_FRAMES = [c610.feedback_id(i) for i in MOTOR_IDS] + list(IMU_FRAMES)
"""Ids of the frames that the bridge uses."""

HEATER_TIMEOUT = 0.5
"""s without a heater command after which the duty becomes zero."""

_NEAR = 0.15  # of a control period: frames that come so near to its end, end it
# s; a rotor makes a third of a turn in it at 25 mm/s, so the guard's record has the right turns when the bridge dies.
_BEAT_PERIOD = 0.01
_HEATER_PERIOD = 0.1  # s
_LONGEST_QUEUE = 256
_SWITCH_INTERVAL = 5e-4  # s; with Python's default of 5 ms another thread could delay the control by as much
_ZEROS_AT_END = 5  # frames
_JOIN_TIMEOUT = 2.0  # s
_PAUSE_AFTER_ERROR = 0.01  # s


@dataclasses.dataclass(frozen=True)
class DriverOptions:
    """Options of the driver."""

    rate: float = 250.0  # Hz, of the control
    state_rate: float = 100.0  # Hz, of the snapshots; every change of the state gives an additional one
    zero: str = "start"  # one of ZERO_POLICIES
    require_imu: bool = True  # hold the cables while no IMU samples come
    guard: bool = True  # drive only with a guard process
    trace: bool = True  # send CommandTrace frames


class BridgeDriver:
    """Runs a Bridge on its buses, with one guard process a bus.

    Attributes: bridge; imu (ImuStream); link; queue of ImuSample and CableSnapshot (None at the end); overruns (control periods
    that were late by more than one period); delay (s, from IMU sample to current frame, of the last command followed).
    """

    def __init__(self, hardware: Hardware, options: DriverOptions = DriverOptions(), *, link: CanBuses | None = None):
        self.bridge = Bridge(hardware, zero=options.zero, require_imu=options.require_imu)
        self.imu = ImuStream()
        self.link = link or CanBuses(hardware.all_buses, hardware.board_bus.name, RECEIVED_FRAMES)
        self.queue: queue.SimpleQueue[ImuSample | CableSnapshot | None] = queue.SimpleQueue()
        self.overruns = 0
        self.delay = 0.0
        self._hardware, self._options = hardware, options
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._ending = threading.Event()
        self._guards: dict[int, GuardClient] = {}  # by the index of the bus
        self._samples: collections.OrderedDict[int, ImuSample] = collections.OrderedDict()
        self._heater = (0.0, -float("inf"))
        self._heater_sequence = 0
        self._queued_state: State | None = None  # state of the last snapshot in the queue

    def open(self) -> None:
        """Open the bus and start to receive; no motor is driven. Raises BusError when the bus cannot be opened."""
        self.link.open()
        # For the calling thread and those that it starts: commands and samples must not wait longer than the control does.
        take_precedence()
        sys.setswitchinterval(_SWITCH_INTERVAL)
        with self._lock:
            self.bridge.configure()
        self._ending.clear()
        self._thread = threading.Thread(target=self._run, name="bridge", daemon=True)
        self._thread.start()

    def activate(self) -> None:
        """Start to drive the motors. Raises GuardError when there is no guard process, or another bridge drives this bus."""
        for bus in range(len(self._hardware.all_buses)) if self._options.guard else ():
            if bus in self._guards:
                continue
            guard = self._guards[bus] = GuardClient.connect(self._hardware, bus=bus)
            if guard.record:
                record = {record_key(bus, can_id): rotor for can_id, rotor in guard.record.items()}
                with self._lock:
                    self.bridge.restore(record)
        with self._lock:
            self.bridge.activate(time.monotonic())

    def deactivate(self) -> None:
        """Send zero current and stop driving."""
        with self._lock:
            self.bridge.deactivate()
            self._send_zeros()

    def close(self) -> None:
        """Send zero current, close the bus, and end the thread and the guard."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join(_JOIN_TIMEOUT)
            self._thread = None
        with self._lock:
            if self.link.is_open:
                self._send_zeros()
            self.bridge.unconfigure()
        for guard in self._guards.values():
            guard.close()
        self._guards.clear()
        self.link.close()
        self.queue.put(None)

    def command(self, displacement: Sequence[float], tension: Sequence[float], stamp_ns: int) -> str | None:
        """Take a command as `Bridge.command` does, and send the currents immediately.

        `stamp_ns` (host clock) is the stamp of the IMU sample from which the command was computed, 0 for none.
        """
        age = time.time() - 1e-9 * stamp_ns if stamp_ns else 0.0
        with self._lock:
            now = time.monotonic()
            reason = self.bridge.command(displacement, tension, now, age=age, stamp=stamp_ns)
            if reason is None:
                self.link.send(self.bridge.tick(now))
                self.delay = age
                sample = self._samples.get(stamp_ns)
                if self._options.trace and sample is not None:
                    self.link.send([codec.encode("CommandTrace", time=sample.board_time, sequence=sample.sequence)])
        return reason

    def request(self, action: Callable[[Bridge, float], tuple[bool, str]]) -> tuple[bool, str]:
        """Call `action(bridge, now)`, send the resulting currents immediately, and return its answer."""
        with self._lock:
            now = time.monotonic()
            answer = action(self.bridge, now)
            self.link.send(self.bridge.tick(now))
        return answer

    def heater(self, duty: float) -> None:
        """Set the heater's duty, 0..1; any other value counts as 0."""
        self._heater = (duty if 0.0 <= duty <= 1.0 else 0.0, time.monotonic())

    def snapshot(self) -> CableSnapshot:
        """Return the present state of the bridge and the cables."""
        with self._lock:
            return self.bridge.snapshot()

    def _run(self) -> None:
        now = time.monotonic()
        self._next_tick = self._next_state = self._next_beat = self._next_heater = now
        while not self._ending.is_set():
            try:
                self._cycle()
            except Exception as error:  # without the thread only the guard would zero the motors, and resume would fail
                self.bridge.stop(f"error in the bridge: {error!r}")
                self.link.send(self.bridge.zero_frames())
                time.sleep(_PAUSE_AFTER_ERROR)

    def _cycle(self) -> None:
        """Receive until the next control period or until frames come; then do what is due.

        Frames that come near the end of a period end it: the currents use the newest feedback, and the thread wakes only once.
        """
        period, state_period = 1.0 / self._options.rate, 1.0 / self._options.state_rate
        near = _NEAR * period
        frames = self.link.receive(max(0.0, self._next_tick + near - time.monotonic()))
        with self._lock:
            now = time.monotonic()
            self._take(frames, now)
            self.bridge.buses_down(self.link.lost)
            if now >= self._next_tick + (-near if frames else near):
                self.link.send(self.bridge.tick(now))
                self.overruns += now > self._next_tick + 2 * period
                self._next_tick = now + period if frames else max(self._next_tick + period, now)
            record = self.bridge.zero_record() if now >= self._next_beat else None
            changed = self.bridge.state is not self._queued_state
            snapshot = self.bridge.snapshot() if changed or now >= self._next_state else None
        if now >= self._next_beat:
            self._next_beat = now + _BEAT_PERIOD
            self._beat(record)
        if snapshot is not None:
            self._next_state = now + state_period if changed else max(self._next_state + state_period, now)
            self._queued_state = snapshot.state
            self._emit(snapshot)
        if now >= self._next_heater:
            self._next_heater = now + _HEATER_PERIOD
            self._send_heater(now)

    def _take(self, frames: list[can.Message], now: float) -> None:
        wall = time.time()
        for frame in frames:
            late = lateness(frame, wall)
            if frame.arbitration_id not in IMU_FRAMES:
                self.bridge.on_frame(frame, now - late)
                continue
            if not self.bridge.on_board_frame(frame, now - late):
                continue
            received = wall - late
            sample = self.imu.on_frame(frame, received)
            if sample is not None:
                stamp_ns = round(1e9 * sample.stamp)
                self._samples[stamp_ns] = sample
                if len(self._samples) > _LONGEST_QUEUE:
                    self._samples.popitem(last=False)
                fault = self.imu.fault
                if fault is None:
                    self.bridge.on_imu_sample(now)
                else:
                    self.bridge.imu_lost(fault)
                self._emit(sample)

    def _emit(self, entry: ImuSample | CableSnapshot) -> None:
        if self.queue.qsize() > _LONGEST_QUEUE:
            with contextlib.suppress(queue.Empty):
                self.queue.get_nowait()
        self.queue.put(entry)

    def _beat(self, record: ZeroRecord | None) -> None:
        for bus, guard in list(self._guards.items()):
            own = record_of_bus(record, bus)
            if not guard.beat(own):
                del self._guards[bus]
                threading.Thread(target=self._new_guard, args=[bus, own], name="guard", daemon=True).start()

    def _new_guard(self, bus: int, record: ZeroRecord | None) -> None:
        """Start another guard of a bus after the last one died; stop the motors when that fails."""
        try:
            guard = GuardClient.connect(self._hardware, record, bus)
        except Exception as error:
            why = f"the guard is gone: {error}"
            self.request(lambda bridge, now: bridge.stop(why))
            return
        self._guards[bus] = guard
        if self._ending.is_set():
            guard.close()

    def _send_heater(self, now: float) -> None:
        duty, since = self._heater
        if self.link.is_open:
            self._heater_sequence = (self._heater_sequence + 1) % 256
            fresh = now - since < HEATER_TIMEOUT
            self.link.send([codec.encode("HeaterCommand", duty=duty if fresh else 0.0, sequence=self._heater_sequence)])

    def _send_zeros(self) -> None:
        for _ in range(_ZEROS_AT_END):
            self.link.send(self.bridge.zero_frames())
