"""Colours of the page. Tension uses the colour map 'plasma', which is readable in grey and with colour vision deficiency."""

import numpy as np

from gravcomp.description import Robot

Rgb = tuple[int, int, int]

PROXIMAL: Rgb = (236, 226, 208)
DISTAL: Rgb = (214, 228, 232)
LUMEN: Rgb = (120, 104, 92)
GHOST: Rgb = (150, 165, 185)
TRUTH: Rgb = (20, 184, 130)
TARGET: Rgb = (232, 62, 140)
GRAVITY: Rgb = (30, 84, 225)
METAL: Rgb = (86, 94, 106)
BOARD: Rgb = (28, 120, 82)
BRAND: Rgb = (47, 111, 237)
WALL: Rgb = (138, 160, 190)
ZONE: Rgb = (239, 68, 68)
PLACED: Rgb = (245, 158, 11)
TISSUE: Rgb = (226, 150, 136)
LOAD: Rgb = (168, 85, 247)

# Full scale of the colours, over the largest tension; compensation of the robot's own weight needs a small part of that.
_TENSION_SHARE = 0.2

_STOPS = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
_PLASMA = np.array([[13, 8, 135], [106, 0, 168], [177, 42, 144], [225, 100, 98], [252, 166, 54], [240, 249, 33]], float)


def tension_scale(robot: Robot) -> float:
    """Return the tension (N) at the full scale of the colours."""
    return _TENSION_SHARE * robot.limits.tension_max


def tension_colour(tension: float, scale: float) -> Rgb:
    """Return the colour of a tension (N); scale: N, full scale."""
    x = min(max(tension / scale, 0.0), 1.0)
    red, green, blue = (int(np.interp(x, _STOPS, _PLASMA[:, i])) for i in range(3))
    return red, green, blue


def css(colour: Rgb) -> str:
    """Return the colour in CSS notation."""
    return "#" + "".join(f"{c:02x}" for c in colour)


def tension_gradient() -> str:
    """Return the colour map of tensions as a CSS gradient."""
    return "linear-gradient(90deg," + ",".join(css((int(r), int(g), int(b))) for r, g, b in _PLASMA) + ")"
