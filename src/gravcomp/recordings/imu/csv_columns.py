"""Which column of a CSV file is what: by a mapping of the user, else by the names of the columns.

    time: Timestamp            # name of the column; time_unit: s, ms, us, ns
    gyro: [wx, wy, wz]         # gyro_unit: rad/s, deg/s, mdeg/s
    accel: [ax, ay, az]        # accel_unit: m/s^2, g, mg
    rate: 256               # where there is no column of time

The names of EuRoC, TUM-VI, RepoIMU, Sensor Logger, phyphox and X-IMU are known, and others that say what they are, in the larger
European languages.
"""

import math
import re
from dataclasses import dataclass

from gravcomp.config import parameter
from gravcomp.recordings.imu.recording import RecordingError
from gravcomp.standard_gravity import STANDARD_GRAVITY

TIME_UNITS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""ns"""

GYRO_UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180.0, "mdeg/s": math.pi / 180e3}
"""rad/s"""

ACCEL_UNITS = {"m/s^2": 1.0, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY}
"""m/s^2"""

_SPELT = {
    "rad/s": r"rad\s*(/|\s)\s*s(ec)?(\^-1|-1)?",
    "mdeg/s": r"m(deg|°|d)\s*/?\s*p?s",
    "deg/s": r"(deg|°|grad|º)\s*/\s*s(ec)?|dps",
    "m/s^2": r"m\s*(/|\s)\s*s(ec)?\s*(\^-?2|²|2|-2)|m\s*/\s*s\s*/\s*s",
    "mg": r"mg|milli-?g",
    "g": r"g",
    "ns": r"ns|nanosec\w*",
    "us": r"us|µs|μs|microsec\w*",
    "ms": r"ms|millisec\w*",
    "s": r"s|sec\w*",
}
_GYRO = (
    r"gyr|giro|angular|w_rs_s|omega|rotation rate|rotationrate|drehrate|winkelgeschw|vitesse angul|velocidad ang|velocit. ang|"
    r"гироск|углов|hoeksnelheid|vinkelhast"
)
_ACCEL = r"acc|a_rs_s|beschleun|aceler|versnelling|przyspiesz|specific.?force|ускор"
_LINEAR = r"linear|without g|ohne g|sans g|sin g|senza g|user.?acc"
_TIME = r"time|zeit|temps|tiempo|tempo\b|tijd|czas|tid\b|время|^t$"
_MORE = r"absol|magnitude|norm\b|betrag|magnet"


@dataclass(frozen=True)
class CsvColumns:
    """Columns of a CSV file by their names."""

    gyro: tuple[str, str, str] = parameter(description="names of the columns of the rate: x, y, z")
    accel: tuple[str, str, str] = parameter(description="names of the columns of the specific force: x, y, z")
    time: str | None = parameter(None, description="name of the column of time")
    orientation: tuple[str, str, str, str] | None = parameter(
        None, description="names of the columns of the true orientation, sensor to earth: w, x, y, z"
    )
    time_unit: str | None = parameter(None, choices=tuple(TIME_UNITS), description="not given: found from the steps")
    gyro_unit: str = parameter("rad/s", choices=tuple(GYRO_UNITS), description="unit of the rate")
    accel_unit: str = parameter("m/s^2", choices=tuple(ACCEL_UNITS), description="unit of the specific force")
    rate: float | None = parameter(None, unit="Hz", minimum=1, maximum=20000, description="where there is no column of time")


@dataclass(frozen=True)
class Found:
    """Columns that the names say: indices of each sensor's axes (three or none), of time, orientation, with their units."""

    gyro: tuple[int, ...]
    accel: tuple[int, ...]
    time: int | None
    orientation: tuple[int, ...]
    time_unit: str | None
    gyro_unit: str | None
    accel_unit: str | None
    linear: bool  # the acceleration is without gravity


def by_mapping(names: tuple[str, ...], mapping: CsvColumns, source: str) -> Found:
    """Return the columns of a mapping. Raises RecordingError for a name that the file does not have."""

    def index(name: str) -> int:
        if name not in names:
            raise RecordingError(f"{source}: has no column '{name}'; found: {', '.join(names)}")
        return names.index(name)

    return Found(
        gyro=tuple(map(index, mapping.gyro)),
        accel=tuple(map(index, mapping.accel)),
        time=None if mapping.time is None else index(mapping.time),
        orientation=() if mapping.orientation is None else tuple(map(index, mapping.orientation)),
        time_unit=mapping.time_unit,
        gyro_unit=mapping.gyro_unit,
        accel_unit=mapping.accel_unit,
        linear=False,
    )


def by_names(names: tuple[str, ...], stem: str, source: str) -> Found:
    """Return the columns that the names say; `stem`: name of the file, which says the sensor where a column is only x, y, z.

    Raises RecordingError for a unit that is not known.
    """
    gyro, accel = _axes(names, _GYRO, "gw", source), _axes(names, _ACCEL, "a", source)
    bare = _axes(names, r"^$", "", source)
    if bare and not gyro and not accel:
        gyro, accel = (bare, ()) if re.search(_GYRO, stem.lower()) else ((), bare)
    linear = bool(accel) and bool(re.search(_LINEAR, (names[accel[0]] if not bare else stem).lower()))
    times = [i for i, name in enumerate(names) if re.search(_TIME, name.lower())]
    turned = tuple(
        i
        for letter in "wxyz"
        for i, name in enumerate(names)
        if re.search(rf"(orientation |q_rs_|quat\w*[ _]){letter}\b", name.lower())
    )
    return Found(
        gyro=gyro,
        accel=accel,
        time=times[0] if times else None,
        orientation=turned if len(turned) == 4 else (),
        time_unit=_unit(names[times[0]], tuple(TIME_UNITS), source) if times else None,
        gyro_unit=_unit(names[gyro[0]], tuple(GYRO_UNITS), source) if gyro else None,
        accel_unit=_unit(names[accel[0]], tuple(ACCEL_UNITS), source) if accel else None,
        linear=linear,
    )


def _axes(names: tuple[str, ...], words: str, letters: str, source: str) -> tuple[int, ...]:
    """Return the columns x, y, z of a sensor, none where they are not all there."""
    found: dict[str, list[int]] = {"x": [], "y": [], "z": []}
    for i, name in enumerate(names):
        plain = re.sub(r"[(\[].*?[)\]]", "", name.lower()).strip()
        if re.search(_MORE, plain):
            continue
        axis = re.search(r"(?:^|[\s_.\-])([xyz])$", plain) or re.search(r"[a-z]([xyz])$", plain)
        rest = plain[: axis.start(1)].strip(" _.-") if axis else ""
        if axis and (re.search(words, rest) or (letters and rest in tuple(letters))):
            found[axis.group(1)].append(i)
    if not all(found.values()):
        return ()
    calibrated = [[i for i in of_axis if not re.search(_LINEAR, names[i].lower())] or of_axis for of_axis in found.values()]
    return tuple(of_axis[0] for of_axis in calibrated)


def _unit(name: str, known: tuple[str, ...], source: str) -> str | None:
    """Return the unit in the brackets of a name, None without one. Raises RecordingError for another one."""
    bracket = re.search(r"[(\[](.*?)[)\]]", name)
    if not bracket:
        return None
    text = bracket.group(1).strip()
    for unit in known:
        if re.fullmatch(_SPELT[unit], text, re.IGNORECASE):
            return unit
    raise RecordingError(f"{source}: column '{name}' is in '{text}'; known units: {', '.join(known)}")
