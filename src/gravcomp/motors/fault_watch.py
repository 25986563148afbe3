"""Detection of faults in feedback, encoders and motors. It reports what is wrong; the bridge changes its state."""

import math
from collections.abc import Collection, Sequence

from gravcomp.description.hardware import COUNTS_PER_TURN, Hardware
from gravcomp.motors.encoder import JUMPS, countable_speed
from gravcomp.motors.monitor import MotorMonitor
from gravcomp.motors.rotors import Rotors

_UNKNOWN_ID_FRAMES = 20  # feedback frames in a row from an id that no cable has
_UNKNOWN_ID_PAUSE = 0.1  # s; a longer pause between two of them ends the row
_FEEDBACK = 0.004  # s between two feedbacks at 500 Hz, of which one is lost


class FaultWatch:
    """Watches the motors of `rotors`. Each check returns a sentence that says what is wrong, or None."""

    def __init__(self, hardware: Hardware, rotors: Rotors):
        self._rotors, self._drive, self._watchdog = rotors, hardware.drive, hardware.watchdog
        self._hardware = hardware
        self._bus = [hardware.bus_index(motor) for motor in hardware.motors]
        self._monitors = [MotorMonitor(hardware.drive, hardware.watchdog) for _ in hardware.motors]
        self._unknown_ids: dict[tuple[int, int], tuple[int, float]] = {}  # bus and id -> frames in a row, time of the last
        self._board_elsewhere: dict[int, tuple[int, float]] = {}  # the same for the IMU board on a bus that is not its own

    def clear(self) -> None:
        """Forget unknown ids and jumps; the encoders accept their next feedback."""
        self._unknown_ids.clear()
        self._board_elsewhere.clear()
        self._rotors.resynchronise_jumped()

    def reset_monitors(self) -> None:
        """Begin to watch stall, runaway and sign again."""
        for monitor in self._monitors:
            monitor.reset()

    def on_unknown_id(self, bus: int, can_id: int, now: float) -> None:
        """Count a feedback frame from a motor that no cable has on the bus with this index."""
        self._unknown_ids[bus, can_id] = _counted(self._unknown_ids.get((bus, can_id)), now)

    def on_board_elsewhere(self, bus: int, now: float) -> None:
        """Count a frame of the IMU board from the bus with this index, which is not the board's."""
        self._board_elsewhere[bus] = _counted(self._board_elsewhere.get(bus), now)

    def silent(self, now: float, down: Collection[int] = ()) -> list[int]:
        """Return the motors that do not answer, with those on the buses (indices) that are down."""
        limit = self._watchdog.feedback_timeout
        return [
            index
            for index, encoder in enumerate(self._rotors.encoders)
            if encoder.count is None or now - encoder.time > limit or self._bus[index] in down
        ]

    def missing(self, silent: Sequence[int]) -> str | None:
        """Motors that do not answer, in words."""
        if not silent:
            return None
        if len(silent) == len(self._rotors.motors):
            return "no motor answers: are the C610 powered, and is the bus connected?"
        return f"no feedback from {', '.join(self._rotors.motors[index].label for index in silent)}"

    def lost_buses(self, silent: Sequence[int]) -> list[str]:
        """Return the names of the buses on which no motor answers, if all others answer completely; else none."""
        lost = [bus for bus in set(self._bus) if all(i in silent for i, own in enumerate(self._bus) if own == bus)]
        complete = all(self._bus[index] in lost for index in silent)
        return (
            [self._hardware.all_buses[bus].name for bus in sorted(lost)] if complete and len(lost) < len(set(self._bus)) else []
        )

    def unknown_id(self) -> str | None:
        """Motors that answer although no cable has their id on that bus, and an IMU board on another bus than its own."""
        buses = self._hardware.all_buses
        for bus, (count, _) in self._board_elsewhere.items():
            if count >= _UNKNOWN_ID_FRAMES:
                return (
                    f"the IMU board answers on bus '{buses[bus].name}', but is described on bus"
                    f" '{self._hardware.board_bus.name}': are the buses swapped?"
                )
        found = [key for key, (count, _) in self._unknown_ids.items() if count >= _UNKNOWN_ID_FRAMES]
        if not found:
            return None
        ids = ", ".join(str(can_id) for _, can_id in found)
        if len(buses) == 1:
            return f"motor id {ids} answers, but no cable has it: check the ids of the C610"
        names = ", ".join(sorted({f"'{buses[bus].name}'" for bus, _ in found}))
        described = [(own, motor.can_id) for own, motor in zip(self._bus, self._rotors.motors)]
        elsewhere = all(any(can_id == known and bus != own for own, known in described) for bus, can_id in found)
        advice = "another bus has it: are the buses swapped?" if elsewhere else "check the ids of the C610"
        return f"motor id {ids} answers on bus {names}, but no cable has it there; {advice}"

    def jumping_angle(self) -> str | None:
        """Encoder whose angle jumps."""
        for motor, encoder in zip(self._rotors.motors, self._rotors.encoders):
            if encoder.jumps >= JUMPS:
                return f"{motor.label}: the rotor's angle jumps; do two C610 have this id?"
        return None

    def uncertain_turns(self) -> str | None:
        """Motors with a zero position whose number of turns is uncertain and can no longer be decided from feedback."""
        unsure = [
            motor.label
            for index, (motor, encoder) in enumerate(zip(self._rotors.motors, self._rotors.encoders))
            if not encoder.certain and not encoder.settling and self._rotors.zeros[index] is not None
        ]
        if not unsure:
            return None
        turn = 1e3 * COUNTS_PER_TURN * self._drive.travel_per_count
        return (
            f"the turns of {', '.join(unsure)} could not be counted: the zero may be off by a multiple of {turn:.2f} mm"
            f"{self._too_fast}"
        )

    @property
    def _too_fast(self) -> str:
        """Clause that names a speed at which the feedback does not tell the turns of a rotor; empty at the drive's speed."""
        per_rpm = COUNTS_PER_TURN / 60.0 * self._drive.travel_per_count  # m/s
        most, limit = countable_speed(_FEEDBACK) * per_rpm, self._drive.velocity_limit
        if limit <= most:
            return ""
        return (
            f" (at hardware.drive.velocity_limit_mm_s, {1e3 * limit:g}, the feedback does not tell the turns: it may be"
            f" {math.floor(1e4 * most) / 10:g} at most)"
        )

    def motor_fault(self, index: int, current: float, velocity: float, lag: float) -> str | None:
        """Stall, runaway or wrong sign of one motor; arguments as of `MotorMonitor.update`."""
        reason = self._monitors[index].update(self._rotors.encoders[index].time, current, velocity, lag)
        return f"{self._rotors.motors[index].label} {reason}" if reason else None


def _counted(before: tuple[int, float] | None, now: float) -> tuple[int, float]:
    """Return the number of frames in a row and the time of the last one, with a frame at `now`."""
    count, last = before or (0, now)
    return (count + 1 if now - last < _UNKNOWN_ID_PAUSE else 1, now)
