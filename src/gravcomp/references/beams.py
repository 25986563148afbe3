"""Two theories of a beam that bends under its own weight, for comparison.

Euler-Bernoulli, small deflections: the tip sags by w L^4 / (8 E I), w = rho A g cos(inclination). Elastica, any deflection, no
stretch and no shear; SciPy's `solve_bvp` solves it: with the angle theta(s) of the axis above the horizontal,

    E I theta'' = rho A g (L - s) cos(theta),    theta(0) = inclination,    theta'(L) = 0.
"""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Tube:
    """A tube: length, outer and inner diameter, Young's modulus, density; SI."""

    length: float
    outer_diameter: float
    inner_diameter: float
    youngs_modulus: float
    density: float

    @property
    def bending_stiffness(self) -> float:
        """E I in N m^2."""
        return self.youngs_modulus * math.pi * (self.outer_diameter**4 - self.inner_diameter**4) / 64

    def weight(self, gravity: float) -> float:
        """rho A g in N/m."""
        return self.density * math.pi / 4 * (self.outer_diameter**2 - self.inner_diameter**2) * gravity


def euler_bernoulli(tube: Tube, inclination: float, gravity: float = 9.81) -> np.ndarray:
    """Return the displacement (3,) of the tip in m, in soft_base, where gravity is g (-cos, 0, -sin) of the inclination (rad)."""
    sag = tube.weight(gravity) * math.cos(inclination) * tube.length**4 / (8 * tube.bending_stiffness)
    return np.array([-sag, 0.0, 0.0])


def elastica(tube: Tube, inclination: float, gravity: float = 9.81) -> np.ndarray:
    """Return the displacement as `euler_bernoulli`. Raises RuntimeError if the boundary-value problem is not solved."""
    from scipy.integrate import solve_bvp

    length, ratio = tube.length, tube.weight(gravity) * tube.length**3 / tube.bending_stiffness
    station = np.linspace(0.0, 1.0, 51)
    guess = np.vstack([np.full_like(station, inclination), np.zeros_like(station)])
    for part in (0.25, 0.5, 0.75, 1.0):  # the weight is applied in parts, so that the solver stays on the hanging branch
        solution = solve_bvp(
            lambda s, y, part=part: np.vstack([y[1], part * ratio * (1 - s) * np.cos(y[0])]),
            lambda a, b: np.array([a[0] - inclination, b[1]]),
            station,
            guess,
            tol=1e-6,
        )
        if solution.status != 0:
            raise RuntimeError(f"elastica at {math.degrees(inclination):g} deg: {solution.message}")
        curve = solution.sol
        guess = curve(station)
    fine = np.linspace(0.0, 1.0, 2001)
    turn = curve(fine)[0] - inclination
    across, along = np.trapezoid(np.sin(turn), fine) * length, np.trapezoid(np.cos(turn), fine) * length
    return np.array([across, 0.0, along - length])
