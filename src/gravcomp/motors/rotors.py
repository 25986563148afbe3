"""Measured state of the motors: their encoders and zero positions, in the order of the motors.

displacement = direction x (count - zero) x travel per count + offset,    force = current x tension per ampere

Displacements and forces are those at the capstans; with one motor a cable they are the cables' (`description.transmission`).
"""

import math

from gravcomp.description.hardware import COUNTS_PER_TURN, Hardware
from gravcomp.motors.encoder import JUMPS, Encoder
from gravcomp.motors.state import ZeroRecord, record_key
from gravcomp.motors.zeros import ZeroPositions


class Rotors:
    """Counts the turns of all rotors and converts them to displacements at the capstans.

    Attributes: motors (hardware.motors), encoders (one per motor), zeros (their zero positions).
    """

    def __init__(self, hardware: Hardware):
        self.motors = hardware.motors
        self.encoders = [Encoder() for _ in self.motors]
        self.zeros = ZeroPositions(len(self.motors))
        self._drive, self._zero_timeout = hardware.drive, hardware.watchdog.zero_timeout
        self._keys = [record_key(hardware.bus_index(motor), motor.can_id) for motor in self.motors]

    def on_feedback(self, index: int, angle: int, speed: float, current: float, now: float) -> bool:
        """Take the feedback of one motor, see `Encoder.update`. Return False when it is implausible.

        After a silence longer than `zero_timeout` the turns and the zero position are lost.
        """
        encoder = self.encoders[index]
        if self._zero_timeout < now - encoder.time < math.inf:
            encoder.forget()
            self.zeros[index] = None
        return encoder.update(angle, speed, current, now)

    @property
    def settling(self) -> bool:
        """Whether the number of turns of any rotor is still being decided."""
        return any(encoder.settling for encoder in self.encoders)

    def counts(self) -> list[int | None]:
        """Counts of the rotors, None before the first feedback."""
        return [encoder.count for encoder in self.encoders]

    def displacement(self) -> list[float]:
        """Displacements (m); 0 while the count or the zero position is unknown."""
        travel, result = self._drive.travel_per_count, []
        for index, motor in enumerate(self.motors):
            count, zero = self.encoders[index].count, self.zeros[index]
            result.append(0.0 if count is None or zero is None else motor.direction * (count - zero) * travel + motor.offset)
        return result

    def velocity(self) -> list[float]:
        """Velocities (m/s)."""
        per_rpm = COUNTS_PER_TURN / 60 * self._drive.travel_per_count
        return [motor.direction * encoder.speed * per_rpm for motor, encoder in zip(self.motors, self.encoders)]

    def current(self) -> list[float]:
        """Measured currents (A); positive currents pull in."""
        return [motor.direction * encoder.current for motor, encoder in zip(self.motors, self.encoders)]

    def force(self) -> list[float]:
        """Forces (N) at the capstans from the measured currents, without friction."""
        return [current * self._drive.tension_per_ampere for current in self.current()]

    def trust_turns(self) -> None:
        """Take all counts as certain."""
        for encoder in self.encoders:
            encoder.trust()

    def resynchronise_jumped(self) -> None:
        """Let every encoder whose angle jumped accept its next feedback."""
        for encoder in self.encoders:
            if encoder.jumps >= JUMPS:
                encoder.resynchronise()

    def set_homed(self, taut: list[float]) -> None:
        """Set the zero positions from the displacements (m, with provisional zero positions) at which the cables are taut."""
        travel = self._drive.travel_per_count
        self.zeros.finish_homing(
            [round(motor.direction * (x - motor.offset) / travel) for x, motor in zip(taut, self.motors)],
        )

    def record(self) -> ZeroRecord | None:
        """Return counts and zero positions for a later run; None while any is unknown.

        During homing the zero positions are those from before it.
        """
        record: ZeroRecord = {}
        for key, encoder, zero in zip(self._keys, self.encoders, self.zeros.lasting):
            rotor = None if zero is None else encoder.record(zero)
            if rotor is None:
                return None
            record[key] = rotor
        return record

    def restore(self, record: ZeroRecord) -> None:
        """Continue from a record, for its motors whose zero position is unknown here.

        Earlier feedback does not matter: a count that began with it has the angle, not the turns.
        """
        for index, key in enumerate(self._keys):
            if key in record and self.zeros[index] is None:
                self.encoders[index].restore(record[key])
                self.zeros[index] = record[key].zero
