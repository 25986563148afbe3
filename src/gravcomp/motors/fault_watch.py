"""Detection of faults in feedback, encoders and motors. It reports what is wrong; the bridge changes its state."""

from gravcomp.description.hardware import COUNTS_PER_TURN, Hardware
from gravcomp.motors.encoder import JUMPS
from gravcomp.motors.monitor import MotorMonitor
from gravcomp.motors.rotors import Rotors

_UNKNOWN_ID_FRAMES = 20  # feedback frames in a row from an id that no cable has
_UNKNOWN_ID_PAUSE = 0.1  # s; a longer pause between two of them ends the row


class FaultWatch:
    """Watches the motors of `rotors`. Each check returns a sentence that says what is wrong, or None."""

    def __init__(self, hardware: Hardware, rotors: Rotors):
        self._rotors, self._drive, self._watchdog = rotors, hardware.drive, hardware.watchdog
        self._monitors = [MotorMonitor(hardware.drive, hardware.watchdog) for _ in hardware.motors]
        self._unknown_ids: dict[int, tuple[int, float]] = {}  # id -> frames in a row, time of the last

    def clear(self) -> None:
        """Forget unknown ids and jumps; the encoders accept their next feedback."""
        self._unknown_ids.clear()
        self._rotors.resynchronise_jumped()

    def reset_monitors(self) -> None:
        """Begin to watch stall, runaway and sign again."""
        for monitor in self._monitors:
            monitor.reset()

    def on_unknown_id(self, can_id: int, now: float) -> None:
        """Count a feedback frame from a motor that no cable has."""
        count, last = self._unknown_ids.get(can_id, (0, now))
        self._unknown_ids[can_id] = (count + 1 if now - last < _UNKNOWN_ID_PAUSE else 1, now)

    def missing_feedback(self, now: float) -> str | None:
        """Motors that do not answer."""
        limit = self._watchdog.feedback_timeout
        silent = [
            motor.label
            for motor, encoder in zip(self._rotors.motors, self._rotors.encoders)
            if encoder.count is None or now - encoder.time > limit
        ]
        if not silent:
            return None
        if len(silent) == len(self._rotors.motors):
            return "no motor answers: are the C610 powered, and is the bus connected?"
        return f"no feedback from {', '.join(silent)}"

    def unknown_id(self) -> str | None:
        """Motors that answer although no cable has their id."""
        ids = [str(can_id) for can_id, (count, _) in self._unknown_ids.items() if count >= _UNKNOWN_ID_FRAMES]
        return f"motor id {', '.join(ids)} answers, but no cable has it: check the ids of the C610" if ids else None

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
        return f"the turns of {', '.join(unsure)} could not be counted: the zero may be off by a multiple of {turn:.2f} mm"

    def motor_fault(self, index: int, current: float, velocity: float, lag: float) -> str | None:
        """Stall, runaway or wrong sign of one motor; arguments as of `MotorMonitor.update`."""
        reason = self._monitors[index].update(self._rotors.encoders[index].time, current, velocity, lag)
        return f"{self._rotors.motors[index].label} {reason}" if reason else None
