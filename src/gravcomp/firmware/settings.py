"""The board's parameters: their keys and kinds as core/parameters.h has them, and their values for a robot's hardware.

The header is the only list of the keys. A parameter in SI units is a float32 on the bus, every other a whole number.
"""

import functools
import re
import struct

from gravcomp.config import ConfigError
from gravcomp.description.hardware import Hardware
from gravcomp.firmware.sources import CORE, firmware_folder
from gravcomp.thermal import HeaterOptions

REAL = frozenset(
    {
        "travel_per_count", "displacement_min", "displacement_max", "velocity_limit", "acceleration_limit", "position_gain",
        "velocity_gain", "velocity_integral", "newton_per_ampere", "tension_limit", "pretension", "homing_velocity",
        "homing_travel", "homing_slack", "following_error", "overspeed", "heater_gain", "heater_integral_time",
        "backlash", "take_up_time",
    }
)  # fmt: skip
"""Parameters that are float32."""

STATES = ("idle", "following", "holding", "released", "fault", "homing", "standalone")
"""Names of the states by number."""

FAULTS = (
    "the IMU does not answer",
    "no valid temperature reading: heater off",
    "too hot: heater off",
    "the host stopped sending currents",
    "a motor does not answer",
    "a motor stalled or ran away",
    "a current was limited",
    "a cable is at the end of its stroke",
    "a bus is off, or was",
    "another board sends the same frames",
    "no stored parameters: defaults",
    "the last reset came from the watchdog",
    "the supply is too low, or caused the last reset",
    "no whole model on the board",
    "homing failed",
    "frames were lost: the bus is too slow or off",
)
"""Meaning of the bits of BoardState.faults."""

OPERATIONS = {"read": 1, "write": 2, "save": 3, "defaults": 4, "zero": 5, "forget": 6, "act": 7}
"""Operations of a BoardRequest."""

ACTIONS = {"stop": 1, "resume": 2, "home": 3, "run": 4, "restart": 5}
"""Keys of the operation `act`."""

RESULTS = (
    "done", "unknown operation", "unknown key", "out of range", "not in this state", "could not be stored",
    "a motor does not answer",
)  # fmt: skip
"""Meaning of the code in BoardReply.result, its low four bits."""

SAVE_WORD, FORGET_WORD = 0x53415645, 0x464F5247
ANY_BOARD = 255
BETWEEN = 1
"""Wiring: the board sits between the host's bus and that of the motors."""


@functools.cache
def keys() -> dict[str, int]:
    """Return the keys of the parameters by name. Raises ConfigError without the folder of the firmware."""
    text = (firmware_folder() / CORE / "parameters.h").read_text(encoding="utf-8")
    body = text[text.index("enum {") : text.index("GC_PARAMETER_COUNT")]
    return {name.lower(): key for key, name in enumerate(re.findall(r"^ +GC_(\w+),", body, re.MULTILINE))}


def word_of(name: str, value: float) -> int:
    """Return the 32 bits of a value. Raises ConfigError for an unknown name or what a word cannot hold."""
    if name not in keys():
        raise ConfigError(f"the board has no parameter {name}; allowed: {', '.join(keys())}")
    if name in REAL:
        return struct.unpack("<I", struct.pack("<f", value))[0]
    if value != int(value) or not 0 <= value <= 0xFFFFFFFF:
        raise ConfigError(f"the board's parameter {name} is {value:g}; a whole number from 0 is needed")
    return int(value)


def value_of(name: str, word: int) -> float:
    """Return the value of a word."""
    return struct.unpack("<f", struct.pack("<I", word))[0] if name in REAL else word


def settings_of(hardware: Hardware, *, between: bool) -> dict[str, float]:
    """Return the parameters of the board for a robot's hardware.

    `between`: the board sits between host and motors and limits the currents; else it is on their bus. The motors are those of
    the board's bus.
    """
    drive, homing, watchdog = hardware.drive, hardware.homing, hardware.watchdog
    own = hardware.all_buses.index(hardware.board_bus)
    pays_out = hardware.transmission.pays_out
    motors = [(m.can_id - 1, m.direction, alone) for m, alone in zip(hardware.motors, pays_out) if hardware.bus_index(m) == own]
    current = 1000.0 * drive.current_limit
    return {
        "wiring": BETWEEN if between else 0,
        "motors": sum(1 << index for index, _, _ in motors),
        "reversed": sum(1 << index for index, direction, _ in motors if direction < 0),
        "two_way": sum(1 << index for index, _, alone in motors if not alone),
        "current_limit": int(current),
        "travel_per_count": drive.travel_per_count,
        "displacement_min": drive.displacement_min,
        "displacement_max": drive.displacement_max,
        "velocity_limit": drive.velocity_limit,
        "acceleration_limit": drive.acceleration_limit,
        "position_gain": drive.position_gain,
        "velocity_gain": drive.velocity_gain,
        "velocity_integral": drive.velocity_integral,
        "newton_per_ampere": drive.tension_per_ampere,
        "tension_limit": drive.tension_limit,
        "pretension": drive.pretension,
        "homing_velocity": homing.velocity,
        "homing_rise": int(1000.0 * homing.current_rise),
        "homing_travel": homing.travel_limit,
        "homing_slack": homing.slack,
        "following_error": watchdog.following_error,
        "overspeed": watchdog.overspeed,
        "stall_time": round(1000.0 * watchdog.stall_time),
        "backlash": drive.backlash * drive.capstan_radius,
        "take_up_time": drive.take_up_time,
    }


WITH_HOST = {"at_start": 0, "heater_own": 0}
"""Parameters of a board whose robot has a host: it does nothing by itself, also where it did before (`settings_alone`)."""


def settings_alone(heater: HeaterOptions) -> dict[str, float]:
    """Return the parameters of a board whose robot has no host: it homes, runs its loop, and heats the IMU as the options say."""
    return {
        "at_start": 1,
        "heater_own": int(heater.enabled),
        "heater_target": 0 if heater.target is None else round(min(heater.target, heater.highest_target)),
        "heater_rise": round(heater.rise),
        "heater_limit": round(1e4 * heater.pid.highest),
        "heater_gain": heater.pid.gain,
        "heater_integral_time": heater.pid.integral_time,
    }
