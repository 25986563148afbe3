"""State machine between cable commands and the controller of a ros2_control robot. It has no threads, no clock, no topics.

The caller passes joint states, commands and requests with the time (s, monotonic), and calls `tick` at the control rate, which
returns what the controller is sent. The table of states is that of `supervisor`, with these differences:

    FAULT, STOPPED   a controller of efforts is sent zeros; one of positions is led to where its joints are, and left there
    any --joint_states missing, controller gone--> FAULT --they are back--> as after activation
    any --stall, runaway, a joint left behind, a jump of an angle, outside the limits--> FAULT (latched) --resume--> HOLDING
"""

from collections.abc import Sequence

from gravcomp.description.hardware import Hardware
from gravcomp.motors.command_check import CommandCheck
from gravcomp.motors.joint_loops import JointLoops
from gravcomp.motors.joint_output import JointOutput
from gravcomp.motors.joint_states import JointStates
from gravcomp.motors.state import DRIVING, CableSnapshot, State
from gravcomp.motors.supervisor import Supervisor

_MARGIN = 0.01  # of the range, by which a joint may be outside its limits at the start


class JointBridge(Supervisor):
    """Drives the joints of `hardware.joints`.

    Attributes: those of `Supervisor`, joints (the measured states). Raises ValueError for hardware without joints.
    """

    _loops: JointLoops

    def __init__(self, hardware: Hardware, *, require_imu: bool = False):
        transmission = hardware.joint_transmission
        assert hardware.joints is not None
        self._by_effort = by_effort = hardware.joints.command == "effort"
        self.joints = JointStates(hardware.joints.motors, hardware.drive, hardware.watchdog)
        self._loops = JointLoops(
            self.joints, hardware.watchdog, transmission.pays_out, by_effort=by_effort, delay=hardware.joints.feedback_delay
        )
        self._output = JointOutput(self.joints, by_effort=by_effort)
        self._wanted: list[float] | None = None
        self._no_controller: str | None = None
        super().__init__(
            transmission,
            hardware.watchdog,
            CommandCheck(hardware.cables, hardware.joints.motors, transmission, self._loops.limits, hardware.watchdog),
            self._loops,
            require_imu=require_imu,
            idle="no effort" if by_effort else "the controller keeps the joints where they are",
            recovery="; call ~/resume to continue",
        )

    def configure(self) -> None:
        """Enter INACTIVE: the topics are there."""
        self._enter(State.INACTIVE, "nothing is sent to the controller")

    def controller(self, missing: str | None) -> None:
        """Take whether the controller is there: None, or why it is not. Without it the bridge is in FAULT."""
        self._no_controller = missing

    def on_joint_states(
        self,
        names: Sequence[str],
        angles: Sequence[float],
        speeds: Sequence[float],
        efforts: Sequence[float],
        now: float,
        stamp: int = 0,
        wall: float | None = None,
    ) -> None:
        """Take measured states, see `JointStates.on_message`."""
        self.joints.on_message(names, angles, speeds, efforts, now, stamp, wall)

    def tick(self, now: float) -> list[float] | None:
        """Run one control period. Return angles (rad) or efforts (N m) in the order of the joints; None: send nothing."""
        self._wanted = None
        dt = self._advance(now)
        if self.state in (State.UNCONFIGURED, State.INACTIVE) or not self.joints.zeros_known:
            return None
        if self.state not in DRIVING and (self._by_effort or self._wanted is None):
            self._wanted = self._loops.rest(dt)
        return None if self._wanted is None else self._output.clamp(self._wanted)

    def last(self) -> list[float] | None:
        """Return what the controller is sent at the end of the bridge: no effort; None: positions stay."""
        return self._loops.rest(0.0) if self._by_effort else None

    def snapshot(self) -> CableSnapshot:
        """Return the state of the bridge and the measured state of the cables; a force that is not measured counts as 0."""
        cables, force = self._transmission, [f or 0.0 for f in self.joints.force()]
        current = [f / scale.drive.tension_per_ampere for f, scale in zip(force, self.joints.scales)]
        return CableSnapshot(
            state=self.state,
            message=self.message,
            command=cables.cables(self._loops.target),
            displacement=cables.cables(self.joints.displacement()),
            velocity=cables.velocities(self.joints.velocity()),
            current=[current[motor] for motor in cables.first_motor],
            tension=cables.tensions(force),
            stamp=self._stamp if self.state is State.ACTIVE else None,
        )

    @property
    def loop_delay(self) -> float | None:
        """Largest delay (s) of the loops of efforts, None with positions."""
        return max(delay.value for delay in self._loops.delays) if self._by_effort else None

    # What Supervisor asks.

    @property
    def _zeros_known(self) -> bool:
        return self.joints.zeros_known

    def _missing(self, now: float) -> str | None:
        return self._no_controller or self.joints.missing(now)

    def _clear_faults(self) -> None:
        self._latched = False
        self.joints.clear_jumps()

    def _begin(self, now: float) -> None:
        self.joints.fill_zeros()
        for motor, x, (low, high) in zip(self.joints.motors, self.joints.displacement(), self._loops.limits()):
            if not low - _MARGIN * (high - low) <= x <= high + _MARGIN * (high - low):
                self._fault(
                    f"{motor.label} is at {1e3 * x:.1f} mm; allowed: {1e3 * low:g} to {1e3 * high:g} mm: is its zero_deg right?",
                    latched=True,
                )
                return
        self._loops.reset()
        self._hold("waiting for commands")

    def _watch(self, now: float) -> None:
        """Check in this order: controller and feedback, jumps, age of command and IMU sample."""
        missing = self._missing(now)
        if missing and self.state in DRIVING:
            self._fault(missing, latched=False)
        if self.state is State.FAULT and not self._latched:
            self._await(missing, now)
        if self.state not in DRIVING:
            return
        fault = self.joints.jumped()
        if fault:
            self._fault(fault, latched=True)
            return
        self._watch_ages(now)

    def _drive(self, now: float, dt: float) -> None:
        self._wanted, fault = self._loops.drive(now, dt)
        self._end_step(fault)
