"""The faults that act at present, each with the time of its end."""

import math

import numpy as np

from gravcomp.canbus import c610
from gravcomp.config import ConfigError
from gravcomp.description.hardware import Hardware
from gravcomp.virtual.faults import Fault


class ActiveFaults:
    """Faults from their injection to their end."""

    def __init__(self, hardware: Hardware):
        self._cables = hardware.cables
        self._motors = hardware.motors
        self._feedback_id = {cable: c610.feedback_id(motor.can_id) for motor in hardware.motors for cable in motor.ratios}
        self._faults: list[tuple[Fault, float]] = []

    @property
    def all(self) -> tuple[Fault, ...]:
        """The faults in the order of their injection."""
        return tuple(fault for fault, _ in self._faults)

    @property
    def of_frames(self) -> list[tuple[Fault, int | None]]:
        """The faults, each with the frame id of its motor's feedback, None where it names no motor."""
        return [(fault, self._feedback_id.get(fault.cable)) for fault, _ in self._faults]

    def check(self, fault: Fault) -> None:
        """Raise ConfigError for a cable that the robot does not have."""
        if fault.cable and fault.cable not in self._cables:
            raise ConfigError(f"fault: cable is '{fault.cable}'; allowed: {', '.join(self._cables)}, or empty for all")

    def add(self, fault: Fault, now: float) -> None:
        """Let the fault act from `now` (s) on."""
        self._faults.append((fault, now + fault.duration if fault.duration > 0.0 else math.inf))

    def clear(self) -> None:
        """End all faults."""
        self._faults.clear()

    def end(self, now: float) -> bool:
        """End the faults whose time is over at `now` (s); return whether there were any."""
        if not any(end <= now for _, end in self._faults):
            return False
        self._faults = [(fault, end) for fault, end in self._faults if end > now]
        return True

    def concerned(self, fault: Fault) -> np.ndarray:
        """Return (m,) bool: the cables that the fault acts on."""
        return np.array([fault.cable in ("", cable) for cable in self._cables])

    def concerned_motors(self, fault: Fault) -> np.ndarray:
        """Return (k,) bool: the motors that the fault acts on."""
        return np.array([fault.cable == "" or fault.cable in motor.ratios for motor in self._motors])
