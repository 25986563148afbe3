"""The page's colours; tension from slack to tight as in the colour map 'plasma', which stays readable in grey and to most eyes."""

import numpy as np

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

# Full scale of the colours: what holding up the robot's own weight takes lies below it.
TENSION_SCALE = 1.0  # N

_STOPS = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
_PLASMA = np.array([[13, 8, 135], [106, 0, 168], [177, 42, 144], [225, 100, 98], [252, 166, 54], [240, 249, 33]], float)


def tension_colour(tension: float, scale: float = TENSION_SCALE) -> Rgb:
    """Colour of a tension in N."""
    x = min(max(tension / scale, 0.0), 1.0)
    return tuple(int(np.interp(x, _STOPS, _PLASMA[:, i])) for i in range(3))


def css(colour: Rgb) -> str:
    """As CSS writes it."""
    return "#" + "".join(f"{c:02x}" for c in colour)


def tension_gradient() -> str:
    """The colour map as a CSS gradient."""
    return "linear-gradient(90deg," + ",".join(css(tuple(map(int, c))) for c in _PLASMA) + ")"
