"""Live plots: tip error, tensions, gravity and delay."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from gravcomp.view import colours
from gravcomp.view.history import History
from gravcomp.view.options import PageOptions
from gravcomp.view.snapshot import Snapshot

STAGES = ("model", "command", "motors")
_AXES = ("#e2574c", "#38a169", "#2f6fed")
_CABLES = ("#e2574c", "#dd8a1f", "#b8a416", "#38a169", "#2f6fed", "#8b5cf6", "#0891b2", "#db2777")


@dataclasses.dataclass(frozen=True)
class _Plot:
    title: str
    labels: tuple[str, ...]
    strokes: tuple[str, ...]
    values: Callable[[Snapshot], list[float]]
    reach: float | None = None  # y axis from -reach to reach; None: from 0 to a value that depends on the data
    least: float = 1.0  # smallest end of such an axis


class Plots:
    """Four plots of the last `options.window` s, in the current GUI container."""

    def __init__(self, server: viser.ViserServer, cables: tuple[str, ...], options: PageOptions) -> None:
        self._plots, self._window = _layout(cables), options.window
        self._history = History(sum(len(p.labels) for p in self._plots), options.window + options.look_back, options.rate)
        self._tops = [plot.least for plot in self._plots]
        self._handles = [_add(server, plot, options.window, options.dark) for plot in self._plots]

    def add(self, snapshot: Snapshot) -> None:
        """Store the plotted values of a snapshot."""
        self._history.add(snapshot.time, np.concatenate([plot.values(snapshot) for plot in self._plots]))

    def draw(self, until: float = math.inf) -> None:
        """Draw the curves up to the time `until` (s, of the snapshots)."""
        time, *columns = self._history.columns(self._window, until)
        if not len(time):
            return
        for i, (plot, handle) in enumerate(zip(self._plots, self._handles)):
            own, columns = columns[: len(plot.labels)], columns[len(plot.labels) :]
            # The range is set here, because the browser's automatic range fails with NaN, and hardware has no ground truth.
            top = top_of(np.concatenate(own), self._tops[i], plot.least)
            if plot.reach is None and top != self._tops[i]:
                self._tops[i] = top
                handle.scales = _scales(self._window, (0.0, top))
            handle.data = (time, *own)


def top_of(values: np.ndarray, top: float, least: float) -> float:
    """Return the end of an axis that begins at 0.

    The current end `top` is kept as long as the values (not negative, NaN: unknown) use a fair part of the axis. Otherwise it
    is the next of 1, 2, 5, 10... with some margin, at least `least`.
    """
    largest = float(np.nanmax(values)) if np.isfinite(values).any() else 0.0
    if max(0.3 * top, least) <= largest <= top or (largest <= top == least):
        return top
    wanted = max(1.1 * largest, least)
    power = 10.0 ** math.floor(math.log10(wanted))
    return max(least, next(digit * power for digit in (1.0, 2.0, 5.0, 10.0) if digit * power >= wanted * (1 - 1e-9)))


def _scales(window: float, y: tuple[float, float]) -> dict:
    return {"x": {"time": False, "range": (-window, 0.0)}, "y": {"range": y}}


def _layout(cables: tuple[str, ...]) -> list[_Plot]:
    def tensions(s: Snapshot) -> list[float]:
        return [math.nan] * len(cables) if s.tension is None else list(s.tension)

    def gravity(s: Snapshot) -> list[float]:
        return [math.nan] * 3 if s.gravity is None else list(s.gravity)

    def errors(s: Snapshot) -> list[float]:
        return [1e3 * s.tip_error, 1e3 * s.true_tip_error]

    def delays(s: Snapshot) -> list[float]:
        return [1e3 * s.delays.get(stage, math.nan) for stage in STAGES]

    strokes = tuple(_CABLES[i % len(_CABLES)] for i in range(len(cables)))
    return [
        _Plot("tip error, mm", ("model", "ground truth"), (colours.css(colours.BRAND), colours.css(colours.TRUTH)), errors),
        _Plot("cable tension, N", cables, strokes, tensions, least=0.2),
        _Plot("gravity in soft_base, m/s²", ("x", "y", "z"), _AXES, gravity, 11.0),
        _Plot("delay since the IMU sample, ms", STAGES, _AXES[::-1], delays, least=5.0),
    ]


def _add(server: viser.ViserServer, plot: _Plot, window: float, dark: bool) -> viser.GuiUplotHandle:
    ink, line = ("#aab4c3", "#2b3340") if dark else ("#5b6675", "#e3e8ee")
    axis: dict[str, Any] = {
        "stroke": ink,
        "grid": {"stroke": line, "width": 1},
        "ticks": {"stroke": line, "width": 1},
        "font": "11px sans-serif",
        "size": 42,
    }
    series: list[Any] = [{"label": "s"}]
    series += [
        {"label": label, "stroke": stroke, "width": 1.6, "points": {"show": False}}
        for label, stroke in zip(plot.labels, plot.strokes)
    ]
    axes: Any = ({"show": False}, axis)
    scales = _scales(window, (0.0, plot.least) if plot.reach is None else (-plot.reach, plot.reach))
    chips = "".join(_chip(label, stroke) for label, stroke in zip(plot.labels, plot.strokes))
    server.gui.add_html(f'<div style="padding:.5em .7em 0;font-size:.82em"><b>{plot.title}</b><br>{chips}</div>')
    return server.gui.add_uplot(
        (np.zeros(1), *(np.full(1, math.nan) for _ in plot.labels)),
        tuple(series),
        scales=scales,
        axes=axes,
        legend={"show": False},
        cursor={"show": False},
        padding=(6, 10, 6, 0),
        height=120,
    )


def _chip(label: str, stroke: str) -> str:
    style = f"display:inline-block;width:.85em;height:.25em;border-radius:.1em;background:{stroke};vertical-align:middle"
    box = f'<span style="{style}"></span>'
    return f'<span style="margin-right:.8em;opacity:.85">{box} {label}</span>'
