"""Units as the headers of CSV files spell them: in brackets behind a name, at the end of it, or in a line of their own."""

import math
import re

from gravcomp.recordings.imu.recording import RecordingError
from gravcomp.standard_gravity import STANDARD_GRAVITY

TIME_UNITS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""ns"""

GYRO_UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180.0, "mdeg/s": math.pi / 180e3}
"""rad/s"""

ACCEL_UNITS = {"m/s^2": 1.0, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY}
"""m/s^2"""

_PER = r"[\s/_]*(per|p)?[\s/_]*"
_SPELT = {
    "rad/s": rf"rad(ian)?s?{_PER}s(ec)?(\^?-1|⁻¹)?|рад\s*/\s*с(ек)?",
    "mdeg/s": rf"m(illi)?-?(deg|°|d){_PER}s(ec)?",
    "deg/s": rf"(deg(ree)?s?|°|grad|º|d){_PER}s(ec)?(\^?-1|⁻¹)?|(град\w*|°)\s*/\s*с(ек)?|(度|°)\s*/\s*秒",
    "m/s^2": (
        r"m[\s/._·*]*p?s(ec)?\s*(\^?-?2|²|⁻²)|m\s*/\s*s\s*/\s*s|mps2|mpss|м\s*/\s*с(ек)?\s*(\^?2|²)|米\s*/\s*秒\s*(\^?2|²)"
    ),
    "mg": r"mg|milli-?g",
    "g": r"g",
    "ns": r"ns|nsecs?|nanos(ec\w*)?",
    "us": r"us|µs|μs|usecs?|micros(ec\w*)?|мкс|微秒",
    "ms": r"ms|msecs?|millis(ec\w*)?|мс(ек)?|毫秒|ミリ秒|밀리초",
    "s": r"s|secs?|seconds?|sekunden?|с|сек\w*|秒|초",
}
_BRACKET = re.compile(r"[(\[{](.*?)[)\]}]")
_SEPARATOR = re.compile(r"[\s_,./:\-]+")


def unit_of(text: str, known: tuple[str, ...] = tuple(_SPELT)) -> str | None:
    """Return the unit among `known` that a text spells, None where it is none."""
    return next((unit for unit in known if re.fullmatch(_SPELT[unit], text.strip(), re.IGNORECASE)), None)


def is_unit(field: str) -> bool:
    """Whether a field of a header is nothing but a unit, with or without brackets."""
    return unit_of(field.strip().strip("()[]{}")) is not None


def plain_name(name: str) -> str:
    """Return a name in small letters without what stands in brackets and without a unit at its end."""
    plain = _BRACKET.sub("", name.lower()).strip()
    for separator in _SEPARATOR.finditer(plain):
        if separator.start() and unit_of(plain[separator.end() :]):
            return plain[: separator.start()]
    return plain


def named_unit(name: str, known: tuple[str, ...], source: str) -> str | None:
    """Return the unit that a name gives, None without one. Raises RecordingError for one in brackets that is not known."""
    bracket = _BRACKET.search(name)
    if bracket:
        unit = unit_of(bracket.group(1), known)
        if unit is None and bracket.group(1).strip():
            raise RecordingError(f"{source}: column '{name}' is in '{bracket.group(1).strip()}'; known units: {', '.join(known)}")
        return unit
    lower = name.lower().strip()
    for separator in _SEPARATOR.finditer(lower):
        unit = unit_of(lower[separator.end() :], known)
        if separator.start() and unit:
            return unit
    return None
