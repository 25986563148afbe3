"""Closed forms of slender beams that touch a wall, for comparison; Euler-Bernoulli, small deflections.

A beam of length L and bending stiffness E I is clamped at 0 and bears the weight w per length across it. With S. Timoshenko,
Strength of Materials, 1930, and for the rod in a tube S. Timoshenko, J. Gere, Theory of Elastic Stability, 1961, section 2.
"""

import math


def pressed_on_plane(weight: float, length: float, stiffness: float, gap: float) -> tuple[float, float]:
    """Return force (N) and deflection of the tip (m) where a plane `gap` m below the unloaded beam holds only the tip.

    weight w in N/m, length in m, stiffness E I in N m^2: F = 3/8 w L - 3 E I gap / L^3.
    """
    return 3.0 / 8.0 * weight * length - 3.0 * stiffness * gap / length**3, gap


def over_peg(weight: float, length: float, stiffness: float, gap: float, place: float) -> tuple[float, float]:
    """Return force (N) and deflection of the tip (m) of a beam that a peg at `place` m from the clamp holds, `gap` m below it."""
    free = weight * place**2 * (6.0 * length**2 - 4.0 * place * length + place**2) / (24.0 * stiffness)
    force = 3.0 * stiffness * (free - gap) / place**3
    without = weight * length**4 / (8.0 * stiffness)
    return force, without - force * place**2 * (3.0 * length - place) / (6.0 * stiffness)


def laid_on_plane(weight: float, stiffness: float, gap: float) -> tuple[float, float]:
    """Return the force (N) at the place where a long beam comes down on a plane `gap` m below it, and that place (m).

    Behind it the plane bears the weight. There y = gap, y' = y'' = 0: l^4 = 72 E I gap / w, F = w l / 3.
    """
    place = (72.0 * stiffness * gap / weight) ** 0.25
    return weight * place / 3.0, place


def buckled_in_tube(weight: float, load: float, length: float, stiffness: float, clearance: float) -> tuple[float, float]:
    """Return force of the wall (N) and deflection of the tip (m) of a rod that an end load presses against a tube around it.

    load P in N along the rod, below 4.49^2 E I / L^2; only the tip touches. With k^2 = P / E I the deflection is

        y = A cos k x + B sin k x + c - (N/P) (L - x) + w/(2 P) (L - x)^2 - w/(P k^2),

    clamped at 0, and y(L) = c gives N. Without weight N = P c / (L - tan(k L) / k), beyond the load pi^2 E I / (4 L^2).
    """
    k = math.sqrt(load / stiffness)
    cosine, sine, bent = math.cos(k * length), math.sin(k * length), weight / k**2
    pushed = (load * clearance + 0.5 * weight * length**2 - bent) * cosine - weight * length * sine / k + bent
    return pushed / (length * cosine - sine / k), clearance
