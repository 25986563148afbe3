"""State machine between commands and motors. It has no threads, no clock and no bus of its own.

The caller passes frames, commands and requests with the time (s, monotonic), and calls `tick` at the control rate, which
returns the frames to send. The table of states and causes is in gravcomp_hw/README.md.

    INACTIVE --activate--> FAULT (waiting for feedback) --all motors answer--> HOLDING, HOMING or STOPPED (by `zero`)
    HOLDING --good commands--> ACTIVE --stale or refused command, stale IMU--> HOLDING
    any --bus, feedback--> FAULT --they are back--> as after activation
    ACTIVE --one of several buses--> HOLDING (the other buses' cables) --it is back--> as after activation
    any --stall, runaway, encoder, wrong id, uncertain turns--> FAULT (latched) --resume, home--> HOLDING, HOMING
    any --stop--> STOPPED;  --release--> cables paid out, then STOPPED;  --home--> HOMING --> HOLDING
"""

from collections.abc import Mapping, Sequence

import can

from gravcomp.canbus import c610, codec
from gravcomp.description.hardware import Hardware
from gravcomp.motors.cable_loops import CableLoops
from gravcomp.motors.command_check import CommandCheck
from gravcomp.motors.fault_watch import FaultWatch
from gravcomp.motors.homing import HomingProcedure, Phase
from gravcomp.motors.output import BusOutputs
from gravcomp.motors.rotors import Rotors
from gravcomp.motors.state import DRIVING, RECOVERY, CableSnapshot, State, ZeroRecord
from gravcomp.motors.supervisor import Supervisor

ZERO_POLICIES = ("start", "home", "home_at_start")
"""Zero position when it is unknown: the present position ('start'), none until ~/home ('home'), by homing ('home_at_start')."""

_SHARED = (
    "no homing: motors that move several cables cannot find a zero position by tightening; hold the robot straight with all its"
    " cables just taut and start with zero: start"
)


class Bridge(Supervisor):
    """Drives the motors of `hardware`.

    `zero` is one of ZERO_POLICIES. Attributes: those of `Supervisor`, report (of the last homing), rejected_frames (counter).
    Raises ValueError for an unknown policy.
    """

    _loops: CableLoops

    def __init__(self, hardware: Hardware, *, zero: str = "start", require_imu: bool = True):
        if zero not in ZERO_POLICIES:
            raise ValueError(f"zero is '{zero}'; allowed: {', '.join(ZERO_POLICIES)}")
        self._rotors = Rotors(hardware)
        self._faults = FaultWatch(hardware, self._rotors)
        self._loops = CableLoops(hardware, self._rotors, self._faults)
        limits = [(hardware.drive.displacement_min, hardware.drive.displacement_max)] * len(hardware.motors)
        super().__init__(
            hardware.transmission,
            hardware.watchdog,
            CommandCheck(hardware.cables, hardware.motors, hardware.transmission, lambda: limits, hardware.watchdog),
            self._loops,
            require_imu=require_imu,
            idle="no current",
            recovery=RECOVERY,
        )
        self.rejected_frames = 0
        self.report = ""
        self._hardware, self._zero_policy = hardware, zero
        self._bus_index = {bus.name: index for index, bus in enumerate(hardware.all_buses)}
        self._index = {(hardware.bus_index(motor), motor.can_id): i for i, motor in enumerate(hardware.motors)}
        self._output = BusOutputs(hardware)
        self._down: frozenset[int] = frozenset()  # indices of the buses that are closed
        self._lost: list[int] = []  # motors without a bus, while the others hold
        self._homing: HomingProcedure | None = None
        self._turns_reported = False

    # Requests.

    def configure(self) -> None:
        """Enter INACTIVE: the bus is open."""
        self._enter(State.INACTIVE, "bus open, no current")

    def activate(self, now: float) -> None:
        """Wait for the feedback of all motors, then drive them."""
        self._turns_reported = False
        super().activate(now)

    def home(self, now: float) -> tuple[bool, str]:
        """Find the zero position of every cable; also recovers from a motor fault."""
        if self.state in (State.UNCONFIGURED, State.INACTIVE):
            return False, "not active: activate the bridge first"
        if self.state is State.HOMING:
            return False, "homing is already running"
        if self._no_homing:
            return False, self._no_homing
        missing = self._missing(now)
        if missing:
            return False, f"cannot home: {missing}"
        self._clear_faults()
        self._start_homing(now)
        return True, self.message

    # Inputs.

    def on_frame(self, message: can.Message, now: float) -> None:
        """Take a frame. Motor feedback is used and counted in `rejected_frames` when it is invalid; other frames are ignored."""
        motor_id = c610.motor_of(message.arbitration_id)
        if motor_id is None or message.is_extended_id:
            return
        try:
            feedback = codec.decode(message).values
        except codec.FrameError:
            self.rejected_frames += 1
            return
        bus = self._bus_of(message)
        index = self._index.get((bus, motor_id))
        if index is None:
            self._faults.on_unknown_id(bus, motor_id, now)
        elif not self._rotors.on_feedback(index, feedback.angle, feedback.speed, feedback.current, now):
            self.rejected_frames += 1

    def on_board_frame(self, message: can.Message, now: float) -> bool:
        """Return whether a frame of the IMU board came on the board's bus; else it is counted as a sign of swapped buses."""
        bus = self._bus_of(message)
        if bus == self._bus_index[self._hardware.board_bus.name]:
            return True
        self._faults.on_board_elsewhere(bus, now)
        return False

    def bus_lost(self, why: str) -> None:
        """Enter FAULT: the bus is lost. The fault ends when all motors answer again."""
        if self.state in DRIVING:
            self._fault(f"CAN bus lost: {why}", latched=False)

    def buses_down(self, lost: Mapping[str, str]) -> None:
        """Take the buses that are closed, with the reasons. All are a fault; without some, the cables of the others hold."""
        self._down = frozenset(self._bus_index[name] for name in lost)
        if len(self._down) == len(self._bus_index):
            self.bus_lost("; ".join(lost.values()))

    def restore(self, record: ZeroRecord) -> None:
        """Continue with the turns and zero positions that a guard kept, see `Rotors.restore`."""
        self._rotors.restore(record)

    # Outputs.

    def tick(self, now: float) -> list[can.Message]:
        """Run one control period: check for faults, change the state, compute the currents. Return the frames to send."""
        self._advance(now)
        if self.state in (State.UNCONFIGURED, State.INACTIVE):
            return []
        return self._output.frames(self._loops.currents, enabled=self.state in DRIVING)

    def zero_frames(self) -> list[can.Message]:
        """Return frames with zero current, for the end of the bridge."""
        return self._output.zero()

    def snapshot(self) -> CableSnapshot:
        """Return the state of the bridge and the measured state of the cables."""
        cables, current = self._transmission, self._rotors.current()
        return CableSnapshot(
            state=self.state,
            message=self.message,
            command=cables.cables(self._loops.target),
            displacement=cables.cables(self._rotors.displacement()),
            velocity=cables.velocities(self._rotors.velocity()),
            current=[current[motor] for motor in cables.first_motor],
            tension=cables.tensions(self._rotors.force()),
            stamp=self._stamp if self.state is State.ACTIVE else None,
        )

    def zero_record(self) -> ZeroRecord | None:
        """Return turns and zero positions for a later run, see `Rotors.record`."""
        return self._rotors.record()

    # Changes of the state.

    @property
    def _zeros_known(self) -> bool:
        return self._rotors.zeros.known

    @property
    def _can_follow(self) -> bool:
        return not self._lost

    def _accept(self) -> None:
        super()._accept()
        self._rotors.trust_turns()

    def _enter(self, state: State, message: str) -> None:
        if self._homing and state is not State.HOMING:
            self._rotors.zeros.abandon_homing()  # no effect after success
            self._homing = None
        self._lost = []
        super()._enter(state, message)

    def _watch(self, now: float) -> None:
        """Check in this order: turns, feedback, unknown ids, encoders, age of command and IMU sample."""
        self._watch_turns()
        silent = self._faults.silent(now, self._down)
        missing = self._faults.missing(silent)
        lost = self._faults.lost_buses(silent)
        if self.state in (State.ACTIVE, State.HOLDING) and lost:
            self._hold_without(lost, silent)
        elif self.state in DRIVING and missing:
            self._fault(missing, latched=False)
        elif self._lost:
            self._await(None, now)
        if self.state is State.FAULT and not self._latched:
            swapped = self._faults.unknown_id() if len(self._bus_index) > 1 else None
            self._await(swapped or missing, now)
        if self.state not in DRIVING:
            return
        fault = self._faults.unknown_id() or self._faults.jumping_angle()
        if fault:
            self._fault(fault, latched=True)
            return
        self._watch_ages(now)

    def _hold_without(self, buses: Sequence[str], motors: list[int]) -> None:
        """Hold the cables of the other buses while `buses` are lost; `motors` (indices) have no current."""
        if motors != self._lost:
            names = ", ".join(f"'{name}'" for name in buses)
            self._hold(f"CAN bus {names} lost: the cables on the other buses hold")
            self._lost = motors
        self._complete_since = None

    def _watch_turns(self) -> None:
        """Do not drive with an uncertain number of turns until the user has decided or homing has found the zero position."""
        if self._turns_reported or self.state is State.HOMING:
            return
        uncertain = self._faults.uncertain_turns()
        if uncertain:
            self._fault(f"{self.message.removesuffix(RECOVERY)}; {uncertain}" if self._latched else uncertain, latched=True)
            self._turns_reported = True

    def _begin(self, now: float) -> None:
        """Hold the cables, or find their zero positions first. All motors answer."""
        if not self._rotors.zeros.known:
            if self._zero_policy == "home":
                self._enter(State.STOPPED, "not homed: call ~/home to find the zero of the cables")
                return
            if self._zero_policy == "home_at_start" and self._no_homing:
                self._enter(State.STOPPED, self._no_homing)
                return
            if self._zero_policy == "home_at_start":
                self._start_homing(now)
                return
            self._rotors.zeros.fill(self._rotors.counts())
        self._loops.reset()
        self._hold("waiting for commands")

    def _start_homing(self, now: float) -> None:
        self._rotors.zeros.begin_homing(self._rotors.counts())
        self._loops.reset()
        self._homing = HomingProcedure(
            self._hardware.homing,
            self._hardware.drive,
            tuple(motor.cable for motor in self._hardware.motors),
            self._rotors.displacement(),
            now,
        )
        self._loops.expect_no_tension()
        self._enter(State.HOMING, self._homing.progress)

    def _end_homing(self, homing: HomingProcedure) -> None:
        self.report = homing.report
        if homing.phase is Phase.FAILED:
            self._fault(f"homing failed: {homing.failure}", latched=True)
            return
        self._rotors.set_homed(homing.zeros)
        self._rotors.trust_turns()
        self._loops.reset()
        self._hold(f"homed: {homing.report}")
        self._loops.follow([0.0] * len(self._hardware.motors), [])

    def _clear_faults(self) -> None:
        self._latched = self._turns_reported = False
        self._faults.clear()

    @property
    def _no_homing(self) -> str:
        """Why not to home; empty where each motor has a cable of its own, which becomes taut without too large a tension."""
        own = all(len(motor.ratios) == 1 and not motor.differential for motor in self._hardware.motors)
        return self._hardware.strong_homing if own else _SHARED

    def _missing(self, now: float) -> str | None:
        return self._faults.missing(self._faults.silent(now, self._down))

    def _bus_of(self, message: can.Message) -> int:
        return self._bus_index.get(str(message.channel), 0)

    def _drive(self, now: float, dt: float) -> None:
        """Compute the currents of this period, and end homing or release when they are done."""
        if self._rotors.settling:  # the displacement may be wrong by a turn, and the loops must not correct that
            self._loops.no_current()
            return
        if self._homing:
            targets = self._homing.step(self._rotors.displacement(), self._rotors.current(), now)
            if self._homing.phase in (Phase.DONE, Phase.FAILED):
                self._end_homing(self._homing)
                return
            self.message = self._homing.progress
            fault = self._loops.step(dt, targets, self._hardware.homing.velocity)
        else:
            fault = self._loops.step(dt, without=self._lost)
        self._end_step(fault)
