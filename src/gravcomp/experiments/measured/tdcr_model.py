"""The robot with nine tendons as a chain with friction: its table, its unknowns, and its tips.

Two kinds of dry friction keep the robot behind its commands, each with the state of a play (M. A. Krasnosel'skii and A. V.
Pokrovskii, Systems with Hysteresis, 1989), which the commands before it decide:

- between servo and robot: a tendon follows its servo by a lag less, in the direction in which the servo last moved;
- in the disks: a segment's bend is opposed by a moment, in the direction in which it last changed. How the bends changed follows
  from the chain without this friction.
"""

import dataclasses
import re

import numpy as np

from gravcomp.calibration.chain import Chain
from gravcomp.calibration.csv_table import CsvTable

SERVOS = (4, 3, 9, 5, 2, 8, 6, 1, 7)  # three a segment, from the base
_PULLED, _TIP = tuple(f"servo_{number}_mm" for number in SERVOS), ("tip_x", "tip_y", "tip_z")
COLUMNS = ("pattern_label", *_PULLED, *_TIP)
"""Columns that a table must have."""

CHAIN = Chain(np.array([60e-3, 62.5e-3, 64e-3]), 4.5e-3, 8e-3, np.repeat([0, 1, 2], 3))
ANGLES = np.radians([190.0, -145.0, -120.0])  # of the first tendon of each segment; from the columns of a linear fit
STIFFNESS = np.log(4.0e6)  # of the tendons over the bending stiffness, in 1/m^3
_TURNED = 0.05  # rad by which a bend changes until its friction has turned round; 0.02 and 0.06 fit alike
_COUNTS = 2  # of the servo's encoder, by which a servo moves before its direction counts


@dataclasses.dataclass(frozen=True)
class Unknown:
    """A block of entries of x: size of one unit of x in SI; prior: deviation of x, infinite where there is none.

    factor: from SI to `unit`; described (n,): what x = 0 stands for, in SI.
    """

    names: tuple[str, ...]
    unit: str
    size: float
    prior: float
    factor: float
    described: tuple[float, ...]


UNKNOWNS = {
    "angle": Unknown(
        tuple(f"angle of segment {i}" for i in (1, 2, 3)), "deg", np.radians(10.0), np.inf, 180 / np.pi, tuple(ANGLES)
    ),
    "gain": Unknown(tuple(f"gain of servo {i}" for i in SERVOS), "", 0.1, 1.0, 1.0, (1.0,) * 9),
    "zero": Unknown(tuple(f"zero of servo {i}" for i in SERVOS), "mm", 1e-3, 3.0, 1e3, (0.0,) * 9),
    "stiffness": Unknown(("tendon stiffness, logarithm",), "", 1.0, np.inf, 1.0, (STIFFNESS,)),
    "turn": Unknown(tuple(f"base rotation {axis}" for axis in "xyz"), "deg", 0.1, 2.0, 180 / np.pi, (0.0,) * 3),
    "place": Unknown(tuple(f"base position {axis}" for axis in "xyz"), "mm", 5e-3, 2.0, 1e3, (0.0,) * 3),
    "shortening": Unknown(("shortening between disks over the squared bend",), "mm", 1e-4, np.inf, 1e3, (0.0,)),
    "lag": Unknown(("lag behind the servos",), "mm", 1e-4, 3.0, 1e3, (0.0,)),
    "friction": Unknown(
        tuple(f"friction of segment {i}, moment over bending stiffness" for i in (1, 2, 3)), "1/m", 1.0, 3.0, 1.0, (0.0,) * 3
    ),
}
"""The entries of x, in this order."""

COUNT = sum(len(unknown.names) for unknown in UNKNOWNS.values())


def values(x: np.ndarray) -> dict[str, np.ndarray]:
    """Return by how much each block differs from what is described, in SI."""
    ends = np.cumsum([len(unknown.names) for unknown in UNKNOWNS.values()])[:-1]
    return {name: part * unknown.size for (name, unknown), part in zip(UNKNOWNS.items(), np.split(x, ends))}


@dataclasses.dataclass(frozen=True)
class Pulls:
    """Rows of a table: pattern (k,), displacement (k, 9) and tip (k, 3) in m; moved (k, 9) and bent (k, 3, 2): friction.

    moved: direction in which each servo last moved, from -1 to 1; bent: that in which each bend last changed, at most 1 long.
    """

    pattern: np.ndarray
    displacement: np.ndarray
    tip: np.ndarray
    moved: np.ndarray
    bent: np.ndarray

    @property
    def single(self) -> np.ndarray:
        """Which rows are pulls of a single tendon (k,)."""
        return np.array(["tendon" in pattern for pattern in self.pattern])

    def rows(self, which: np.ndarray) -> "Pulls":
        """Return some rows."""
        return Pulls(*(getattr(self, field.name)[which] for field in dataclasses.fields(self)))

    def with_path(self, x: np.ndarray) -> "Pulls":
        """Return the same rows, in their order, with the directions of the bends of the chain x without friction in its disks."""
        path = bends(x, dataclasses.replace(self, bent=np.zeros_like(self.bent)))
        return dataclasses.replace(self, bent=np.stack([play(path[:, i], _TURNED) for i in range(path.shape[1])], axis=1))


def read(table: CsvTable) -> Pulls:
    """Read a table, in the order of its column `timestamp`, or of its rows where it has none. Raises MeasurementError.

    The part of a pattern in which it is held, and its repetitions, bear the name of the pattern.
    """
    table.require(COLUMNS)
    displacement, places = table.vectors(_PULLED, 1e-3), table.vectors(_TIP, 1e-3)
    order = np.arange(len(table.rows))
    if "timestamp" in table.header:
        order = np.argsort(table.numbers("timestamp"), kind="stable")
    names = [re.sub(r"^rep\d+_|_hold$", "", label) for label in table.texts("pattern_label")]
    displacement = displacement[order]
    steps = np.abs(np.diff(np.sort(displacement, axis=0), axis=0))
    count = float(np.min(steps[steps > 1e-6], initial=np.inf))  # smallest difference: a count of the encoder
    moved = np.zeros_like(displacement)
    if np.isfinite(count):
        moved = np.stack([play(column[:, None], _COUNTS * count)[:, 0] for column in displacement.T], axis=1)
    return Pulls(np.array(names)[order], displacement, places[order], moved, np.zeros((len(order), len(CHAIN.length), 2)))


def play(path: np.ndarray, half: float) -> np.ndarray:
    """Return where in its play a path (k, d) is, over the half width `half`: (k, d) of length 1 at most; 0 at the start."""
    found = np.zeros_like(path)
    middle = path[0] if len(path) else None
    for number, place in enumerate(path):
        away = place - middle
        distance = float(np.sqrt(away @ away))
        if distance > half:
            away *= half / distance
            middle = place - away
        found[number] = away / half
    return found


def chain(x: np.ndarray) -> Chain:
    """Return the chain of x."""
    return dataclasses.replace(CHAIN, shortening=float(values(x)["shortening"][0]))


def driven(x: np.ndarray, pulls: Pulls) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """Return what drives the chain: displacements (k, 9), angles (9,) and stiffness of the tendons, friction (k, 3, 2)."""
    value = values(x)
    displacement = pulls.displacement * (1.0 + value["gain"]) + value["zero"] - value["lag"] * pulls.moved
    angle = np.repeat(ANGLES + value["angle"], 3) + np.tile(np.radians([0.0, 120.0, 240.0]), 3)
    return displacement, angle, float(np.exp(STIFFNESS + value["stiffness"][0])), value["friction"][:, None] * pulls.bent


def bends(x: np.ndarray, pulls: Pulls, start: np.ndarray | None = None) -> np.ndarray:
    """Return the bends (k, 3, 2) in rad; start: bends from which the search begins."""
    found, _ = chain(x).bends(*driven(x, pulls), start)
    return found


def tips(x: np.ndarray, bent: np.ndarray) -> np.ndarray:
    """Return the tips (k, 3) in m for bends (k, 3, 2)."""
    from scipy.spatial.transform import Rotation

    value = values(x)
    return np.asarray(Rotation.from_rotvec(value["turn"]).apply(CHAIN.tips(bent)) + value["place"])


def predict(x: np.ndarray, pulls: Pulls) -> np.ndarray:
    """Return the tips (k, 3) in m."""
    return tips(x, bends(x, pulls))
