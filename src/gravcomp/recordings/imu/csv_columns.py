"""Which column of a CSV file is what: by a mapping of the user, else by the names of the columns.

    time: Timestamp            # name of the column; time_unit: s, ms, us, ns
    gyro: [wx, wy, wz]         # gyro_unit: rad/s, deg/s, mdeg/s
    accel: [ax, ay, az]        # accel_unit: m/s^2, g, mg
    rate: 256               # where there is no column of time

The names of EuRoC, TUM-VI, RepoIMU, Sensor Logger, phyphox and X-IMU are known, and others that say what they are, in the larger
languages. How units are spelt: `csv_units`.
"""

import re
from dataclasses import dataclass

from gravcomp.config import parameter
from gravcomp.recordings.imu.csv_units import ACCEL_UNITS, GYRO_UNITS, TIME_UNITS, named_unit, plain_name
from gravcomp.recordings.imu.recording import RecordingError

_GYRO = (
    r"gyr|giro|żyro|angular|ang.?vel|w_rs_s|omega|rotation.?rate|turn.?rate|drehrate|winkelgeschw|vitesse angul|velocidad ang|"
    r"velocit. ang|kątow|úhlov|гироск|углов|hoeksnelheid|vinkelhast|kulmanopeus|açısal|szögseb|角速度|陀螺|ジャイロ|각속도|자이로"
)
_ACCEL = (
    r"acc|a_rs_s|beschleun|aceler|versnelling|przyspiesz|zrychlen|specific.?force|ускор|kiihtyvyys|ivme|gyorsul|加速度|가속도"
)
_LINEAR = r"linear(?!_acc|\.acc)|without g|ohne g|sans g|sin g|senza g|user.?acc"  # in ROS linear_acceleration is with gravity
_TIME = (
    r"time|stamp|epoch|elapsed|zeit|temps|tiempo|tempo\b|tijd|czas|čas|\btid\b|aika|zaman|idő|время|时间|時間|時刻|시간|"
    r"^t$|^(milli|micro|nano)?s(ec(ond)?s?)?$|^(millis|micros|nanos)$"
)
_WHOLE_SECONDS, _NANOSECONDS = r"(^|[^a-z])secs?(onds?)?$", r"(^|[^a-z])n(ano)?secs?(onds?)?$"  # of a stamp in two columns
_MORE = r"absol|magnitude|norm\b|betrag|magnet|covariance|bias"
_AXIS = (
    r"(?:^|[\s_.\-/])([xyz])(?:[\s_\-]?(?:axis|achse))?$",
    r"[^\W\d_]([xyz])(?:[\s_\-]?(?:axis|achse))?$",
    r"^([xyz])(?:[\s_\-]?(?:axis|achse))?[\s_.\-]",
    r"^([xyz])(?=[^\x00-\x7f])",
)  # at the end of a name, or at its begin


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
    nanoseconds: int | None = None  # of a stamp whose column of time has the whole seconds


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
        gyro, accel = (bare if re.search(words, stem.lower()) else () for words in (_GYRO, rf"{_ACCEL}|grav"))
    linear = bool(accel) and bool(re.search(_LINEAR, (names[accel[0]] if accel != bare else stem).lower()))
    times = [i for i, name in enumerate(names) if re.search(_TIME, plain_name(name)) or re.search(_TIME, name.lower())]
    whole, nanoseconds = (
        next((i for i, name in enumerate(names) if re.search(words, name.lower())), None)
        for words in (_WHOLE_SECONDS, _NANOSECONDS)
    )
    in_two = whole is not None and nanoseconds is not None
    time = whole if in_two else _time(names, times, source)
    turned = tuple(
        i
        for letter in "wxyz"
        for i, name in enumerate(names)
        if re.search(rf"(orientation |q_rs_|quat\w*[ _]){letter}\b", name.lower())
    )
    return Found(
        gyro=gyro,
        accel=accel,
        time=time,
        orientation=turned if len(turned) == 4 else (),
        time_unit="s" if in_two else _unit(names, (time,), tuple(TIME_UNITS), source) if time is not None else None,
        gyro_unit=_unit(names, gyro, tuple(GYRO_UNITS), source),
        accel_unit=_unit(names, accel, tuple(ACCEL_UNITS), source),
        linear=linear,
        nanoseconds=nanoseconds if in_two else None,
    )


def _axes(names: tuple[str, ...], words: str, letters: str, source: str) -> tuple[int, ...]:
    """Return the columns x, y, z of a sensor, none where they are not all there."""
    found: dict[str, list[int]] = {"x": [], "y": [], "z": []}
    for i, name in enumerate(names):
        plain = plain_name(name)
        if re.search(_MORE, plain):
            continue
        axis = next(filter(None, (re.search(pattern, plain) for pattern in _AXIS)), None)
        rest = (plain[: axis.start(1)] + plain[axis.end(1) :]).strip(" _.-") if axis else ""
        if axis and (re.search(words, rest) or (letters and rest in tuple(letters))):
            found[axis.group(1)].append(i)
    if not all(found.values()):
        return ()
    calibrated = [[i for i in of_axis if not re.search(_LINEAR, names[i].lower())] or of_axis for of_axis in found.values()]
    return tuple(of_axis[0] for of_axis in calibrated)


def _time(names: tuple[str, ...], times: list[int], source: str) -> int | None:
    """Return the first of the columns of time whose unit is known or not given, None without one. Raises RecordingError."""
    refusals = []
    for column in times:
        try:
            named_unit(names[column], tuple(TIME_UNITS), source)
        except RecordingError as error:
            refusals.append(error)
        else:
            return column
    if refusals:
        raise refusals[0]
    return None


def _unit(names: tuple[str, ...], columns: tuple[int, ...], known: tuple[str, ...], source: str) -> str | None:
    """Return the unit that the names of columns give, None without one. Raises RecordingError where they differ."""
    units = {named_unit(names[column], known, source): names[column] for column in columns}
    if len(units) > 1:
        listed = ", ".join(f"'{name}'" for name in units.values())
        raise RecordingError(f"{source}: the columns {listed} of one sensor are in different units")
    return next(iter(units), None)
