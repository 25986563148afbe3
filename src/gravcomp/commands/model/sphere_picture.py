"""Picture of the sphere of gravity directions: what the cables need in each, over what their limits allow."""

from typing import TYPE_CHECKING

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from gravcomp.holdability.answer import Binding
from gravcomp.holdability.directions import angles

if TYPE_CHECKING:
    from gravcomp.holdability import Holdability

_STEPS = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0]
_HELD = ["#e3f1ec", "#b7dfd0", "#7dc4aa", "#3fa183", "#16735a"]
_NOT_HELD = {
    Binding.TENSION: ("#f4a259", "tension limit"),
    Binding.DISPLACEMENT: ("#e9c46a", "displacement limit"),
    Binding.CABLES: ("#9d8189", "no cable brings it nearer"),
    Binding.BUCKLING: ("#c8553d", "buckles"),
    Binding.EQUILIBRIUM: ("#8c2f39", "equilibrium ends, or search ended"),
    Binding.TARGET: ("#6c757d", "target out of reach"),
}
_CELLS = 2.0  # deg: size of the cells that are drawn


def save(answer: "Holdability", name: str, file: str) -> None:
    """Draw the sphere into a file: the azimuth of gravity to the right, its inclination to the robot's axis downward."""
    figure = Figure(figsize=(8.5, 5.0), layout="constrained")
    axes = figure.add_subplot()
    colours = ListedColormap(_HELD)
    norm = BoundaryNorm(_STEPS, colours.N)
    points = np.array([direction.direction for direction in answer.directions])
    azimuth, inclination = np.meshgrid(np.arange(-180.0, 180.0, _CELLS), np.arange(0.0, 180.0, _CELLS))
    corners = np.array([[0.0, 0.0], [_CELLS, 0.0], [_CELLS, _CELLS], [0.0, _CELLS]])
    cells = np.stack([azimuth.ravel(), inclination.ravel()], axis=1)
    a, t = np.radians(cells + 0.5 * _CELLS).T
    nearest = np.argmax(np.stack([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)], axis=1) @ points.T, axis=1)
    fill = [colours(norm(min(d.demand or 0.0, 0.999))) if d.held else _NOT_HELD[d.binding][0] for d in answer.directions]
    axes.add_collection(PolyCollection(list(cells[:, None] + corners), facecolors=[fill[k] for k in nearest], linewidths=0))
    for direction in answer.directions:
        t_deg, a_deg = np.degrees(angles(direction.direction))
        # The share at the place of each computed direction: of the limits where it is held, of gravity where it is not.
        text = f"{100 * (direction.demand or 0.0):.0f}" if direction.held else f"{100 * direction.share:.0f}!"
        axes.annotate(
            text,
            (min(max(a_deg, -176.0), 176.0), min(max(t_deg, 4.0), 176.0)),
            fontsize=7,
            ha="center",
            va="center",
            clip_on=True,
        )
    worst = np.degrees(angles(answer.directions[answer.worst].direction))
    axes.plot(worst[1], worst[0], "o", markersize=17, markerfacecolor="none", markeredgecolor="black", label="worst direction")
    axes.set(
        xlim=(-180, 180), ylim=(180, 0), xticks=range(-180, 181, 60), yticks=range(0, 181, 30),
        xlabel="gravity toward / deg about z, from x",
        ylabel="angle of gravity to the robot's axis / deg\n(0: from base to tip, 90: horizontal)",
    )  # fmt: skip
    axes.set_title(f"{name}: {100 * answer.held_share:.0f} % of the directions held", fontsize=11)
    present = {direction.binding for direction in answer.directions if not direction.held}
    for binding, (colour, label) in _NOT_HELD.items():
        if binding in present:
            axes.plot([], [], "s", color=colour, label=f"not held: {label} (number: % of gravity)")
    mappable = matplotlib.cm.ScalarMappable(norm, colours)
    bar = figure.colorbar(mappable, ax=axes, shrink=0.8)
    bar.set_label("held: needed over allowed (number: %)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), fontsize=8, frameon=False, ncols=2)
    figure.savefig(file, dpi=130)
