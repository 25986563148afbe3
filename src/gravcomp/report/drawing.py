"""Drawings as SVG text for a page, all in one style: `with Drawing(...) as drawing:` gives `drawing.axes`.

Colours are those of Okabe and Ito, which can be distinguished with any colour vision. Grey: rest shape, blue: simulated,
vermilion: measured, green: target.
"""

import io
from typing import Any

import numpy as np

REST, MODEL, REAL, TARGET, WITHOUT = "#9aa3ad", "#0072b2", "#d55e00", "#009e73", "#cc79a7"
CYCLE = (MODEL, REAL, TARGET, WITHOUT, "#e69f00", "#56b4e9", "#4d4d4d")

_STYLE: dict[Any, Any] = {
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
    # A fixed salt: the same drawing gives the same text, so that reports can be compared.
    "svg.hashsalt": "gravcomp",
}


class Drawing:
    """Figure with `rows` x `columns` axes (`axes`: array of that shape, squeezed) in the with-block; afterwards `svg` is set."""

    def __init__(self, rows: int = 1, columns: int = 1, *, width: float = 9.0, height: float = 3.2, **options: Any):
        self._arguments = rows, columns, width, height, options
        self.svg = ""

    def __enter__(self) -> "Drawing":
        from gravcomp.environment.packages import provide_extra

        provide_extra("reports")
        import matplotlib
        from cycler import cycler

        self._context = matplotlib.rc_context({**_STYLE, "axes.prop_cycle": cycler(color=CYCLE)})
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
    """Draw outline and axis of the robot in mm, from its backbone (b, 2) in the plane of the drawing and its diameter, in m."""
    points = _smooth(np.asarray(backbone) * 1e3)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) * diameter * 500.0
    outline = np.concatenate([points + normal, (points - normal)[::-1]])
    axes.fill(*outline.T, facecolor=colour, alpha=0.22 * alpha, edgecolor=colour, linewidth=0.9)
    axes.plot(*points.T, color=colour, linewidth=1.3, alpha=alpha, label=label)


def equal_axes(axes: Any, horizontal: str = "horizontal in mm", vertical: str = "height in mm") -> None:
    """Give both axes the same scale, and label them."""
    axes.set_aspect("equal")
    axes.set_xlabel(horizontal)
    axes.set_ylabel(vertical)


def side_view(backbone: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Project a backbone (b, 3) in soft_base onto the vertical plane that contains the axis of the base. Returns (b, 2).

    base (3, 3): world from soft_base, without rotation about the vertical, as `base_orientation` returns it.
    """
    world = np.asarray(backbone) @ np.asarray(base).T
    return world[..., [0, 2]]


def _smooth(points: np.ndarray) -> np.ndarray:
    """Return ten times as many points on a cubic spline through the points."""
    from scipy.interpolate import CubicSpline

    along = np.linspace(0.0, 1.0, len(points))
    return CubicSpline(along, points)(np.linspace(0.0, 1.0, 10 * len(points)))
