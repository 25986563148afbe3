"""Directions of gravity on the sphere, in rings around the axis of the robot."""

import numpy as np


def sphere(equator: int, turns: int = 1) -> np.ndarray:
    """Return unit vectors (k, 3) of directions in `soft_base`: rings at equal inclinations, `equator` of them on the equator.

    A ring at the inclination t to the z axis has about `equator` sin t directions, the first toward x; each pole is one. turns:
    number of turns about z that map the robot onto itself, of which the number in a ring is a multiple, if that is not many more.
    """
    step = turns if turns <= equator // 2 else 1
    found = []
    for ring in range(equator // 2 + 1):
        inclination = np.pi * ring / (equator // 2)
        wanted = equator * np.sin(inclination)
        count = 1 if ring in (0, equator // 2) else step * max(1, round(wanted / step))
        for azimuth in 2.0 * np.pi * np.arange(count) / count:
            found.append(direction(inclination, azimuth))
    return np.array(found)


def direction(inclination: float, azimuth: float) -> np.ndarray:
    """Return the unit vector (3,) at the inclination to the z axis and the azimuth from x about z, both in rad."""
    across = np.sin(inclination)
    return np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.cos(inclination)])


def angles(vector: np.ndarray) -> tuple[float, float]:
    """Return the inclination to the z axis and the azimuth from x about z of a vector (3,), both in rad."""
    across = float(np.hypot(vector[0], vector[1]))
    return float(np.arctan2(across, vector[2])), float(np.arctan2(vector[1], vector[0])) if across > 1e-12 else 0.0
