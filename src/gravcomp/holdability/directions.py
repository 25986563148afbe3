"""Directions of gravity on the sphere, in rings around the axis of the robot."""

import numpy as np


def sphere(equator: int) -> np.ndarray:
    """Return unit vectors (k, 3) of directions in `soft_base`: rings at equal inclinations, `equator` of them on the equator.

    A ring at the inclination t to the z axis has about `equator` sin t directions, the first toward x; each pole is one.
    """
    found = []
    for ring in range(equator // 2 + 1):
        inclination = np.pi * ring / (equator // 2)
        count = max(1, round(equator * np.sin(inclination)))
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
