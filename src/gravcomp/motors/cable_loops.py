"""Position loops of all motors: from targets and expected forces at the capstans to motor currents."""

from collections.abc import Collection, Sequence

from gravcomp.description.hardware import Hardware
from gravcomp.motors.fault_watch import FaultWatch
from gravcomp.motors.loop import REST_COUNTS, PositionLoop
from gravcomp.motors.rotors import Rotors
from gravcomp.motors.take_up import TakeUp, act_together, targets_to_hold


class CableLoops:
    """The loops of the motors of `hardware`, with the measured state from `rotors`.

    Attributes: target (m, at the capstan), currents (A, in the motors' own direction); one entry per motor.
    """

    def __init__(self, hardware: Hardware, rotors: Rotors, faults: FaultWatch):
        self._hardware, self._rotors, self._faults = hardware, rotors, faults
        n = len(hardware.motors)
        self._pays_out = hardware.transmission.pays_out
        self._loops = [PositionLoop(hardware.drive, two_way=not alone) for alone in self._pays_out]
        rest_error = REST_COUNTS * hardware.drive.travel_per_count  # m
        # A motor that pulls antagonists has them on both flanks of its gear.
        self._take_up = [TakeUp(hardware.drive, rest_error) if alone else None for alone in self._pays_out]
        self._tension = [0.0] * n
        self.target, self.currents = [0.0] * n, [0.0] * n

    @property
    def arrived(self) -> bool:
        """Whether every setpoint is on its target."""
        return all(loop.setpoint == target for loop, target in zip(self._loops, self.target))

    def reset(self) -> None:
        """Start at rest at the measured displacements."""
        for loop, displacement in zip(self._loops, self._rotors.displacement()):
            loop.reset(displacement)
        for take_up in self._take_up:
            if take_up is not None:
                take_up.reset()
        self._faults.reset_monitors()

    def follow(self, displacement: Sequence[float], tension: Sequence[float]) -> None:
        """Set targets (m), clamped to the displacement limits, and expected forces (N; none: 0)."""
        drive = self._hardware.drive
        self.target = [min(max(x, drive.displacement_min), drive.displacement_max) for x in displacement]
        self._tension = list(tension) or [0.0] * len(self.target)

    def hold(self) -> None:
        """Keep the cables where their setpoints are now; the expected tensions stay."""
        self.target = targets_to_hold(self.target, self._take_up, [loop.setpoint for loop in self._loops])

    def pay_out(self) -> None:
        """Move all cables to `displacement_min`; motors with antagonists go to zero, where no cable is pulled in."""
        farthest = self._hardware.drive.displacement_min
        self.follow([farthest if alone else 0.0 for alone in self._pays_out], [])

    def expect_no_tension(self) -> None:
        """Set the expected tensions to 0."""
        self._tension = [0.0] * len(self._tension)

    def no_current(self) -> None:
        """Set all currents to zero."""
        self.currents = [0.0] * len(self.currents)

    def step(
        self,
        dt: float,
        targets: Sequence[float] | None = None,
        velocity_limit: float | None = None,
        without: Collection[int] = (),
    ) -> str | None:
        """Compute the currents of one control period of `dt` s. Return the fault of a motor, or None.

        `targets` (m) and `velocity_limit` (m/s) replace the attribute and the drive's limit, for homing. Motors `without` a bus
        get zero current.
        """
        homing = targets is not None
        targets = self.target if targets is None else targets
        displacement, velocity = self._rotors.displacement(), self._rotors.velocity()
        act_together([take_up for i, take_up in enumerate(self._take_up) if i not in without])
        for i, loop in enumerate(self._loops):
            if i in without:
                self.currents[i] = 0.0
                continue
            target, limit, take_up = targets[i], velocity_limit, self._take_up[i]
            if take_up is not None and not homing:
                target, limit = take_up.step(target, displacement[i], dt)
            current = loop.step(target, self._tension[i], displacement[i], velocity[i], dt, limit)
            fault = self._faults.motor_fault(i, current, velocity[i], loop.setpoint - displacement[i])
            if fault:
                return fault
            self.currents[i] = self._hardware.motors[i].direction * current
        return None
