"""Drawings as SVG, all in one style: `with drawing(...) as axes:` gives axes, and the result is text to be put into a page.

Colours are Okabe's and Ito's, which people with any colour vision tell apart. Grey is the robot at rest, blue what is simulated, vermilion
what is measured, green what is wanted.
"""

import io
from typing import Any

import numpy as np

REST, MODEL, REAL, TARGET, WITHOUT = "#9aa3ad", "#0072b2", "#d55e00", "#009e73", "#cc79a7"
CYCLE = (MODEL, REAL, TARGET, WITHOUT, "#e69f00", "#56b4e9", "#4d4d4d")

_STYLE = {
    "figure.facecolor": "none",
    "axes.facecolor": "white",
    "axes.edgecolor": "#c4cad1",
    "axes.labelcolor": "#37404a",
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlecolor": "#1c232b",
    "axes.labelsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e8ebef",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "xtick.color": "#5b6570",
    "ytick.color": "#5b6570",
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.6,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "svg.fonttype": "path",
    # The same drawing gives the same text, so that reports of the same run can be compared.
    "svg.hashsalt": "gravcomp",
}


class Drawing:
    """Axes in `rows` x `columns` (axes: an array of that shape, squeezed) and, after the with-block, `svg`."""

    def __init__(self, rows: int = 1, columns: int = 1, *, width: float = 9.0, height: float = 3.2, **options: Any):
        self._arguments = rows, columns, width, height, options
        self.svg = ""

    def __enter__(self) -> "Drawing":
        from gravcomp.environment.packages import provide_extra

        provide_extra("reports")
        import matplotlib

        self._context = matplotlib.rc_context({**_STYLE, "axes.prop_cycle": matplotlib.cycler(color=CYCLE)})
        self._context.__enter__()
        from matplotlib.figure import Figure

        rows, columns, width, height, options = self._arguments
        self.figure = Figure(figsize=(width, height), layout="constrained")
        self.axes = self.figure.subplots(rows, columns, **options)
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        try:
            if kind is None:
                text = io.StringIO()
                self.figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
                svg = text.getvalue()
                self.svg = svg[svg.index("<svg") :]
        finally:
            self._context.__exit__(None, None, None)


def draw_robot(
    axes: Any, backbone: np.ndarray, colour: str, label: str | None = None, diameter: float = 9e-3, alpha: float = 1.0
) -> None:
    """The robot's outline and axis from its backbone (b, 2), in m, in the plane of the drawing, in mm."""
    points = _smooth(np.asarray(backbone) * 1e3)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) * diameter * 500.0
    outline = np.concatenate([points + normal, (points - normal)[::-1]])
    axes.fill(*outline.T, facecolor=colour, alpha=0.22 * alpha, edgecolor=colour, linewidth=0.9)
    axes.plot(*points.T, color=colour, linewidth=1.3, alpha=alpha, label=label)


def equal_axes(axes: Any, horizontal: str = "horizontal in mm", vertical: str = "height in mm") -> None:
    """Both axes in mm to the same scale."""
    axes.set_aspect("equal")
    axes.set_xlabel(horizontal)
    axes.set_ylabel(vertical)


def side_view(backbone: np.ndarray, base: np.ndarray) -> np.ndarray:
    """(b, 2): a backbone (b, 3) in soft_base, seen from the side in the vertical plane that holds the base's axis.

    base (3, 3): world from soft_base, without roll about the vertical (`base_orientation` gives such ones).
    """
    world = np.asarray(backbone) @ np.asarray(base).T
    return world[..., [0, 2]]


def _smooth(points: np.ndarray) -> np.ndarray:
    """A cubic spline through the points, drawn finely."""
    from scipy.interpolate import CubicSpline

    along = np.linspace(0.0, 1.0, len(points))
    return CubicSpline(along, points)(np.linspace(0.0, 1.0, 10 * len(points)))
