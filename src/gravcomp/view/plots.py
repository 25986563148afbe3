"""Live plots: tip error, tensions, gravity, delay."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import viser
from viser import uplot

from gravcomp.view import colours
from gravcomp.view.history import History
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
    reach: float | None = None  # y from -reach to reach; None: as the data asks for


class Plots:
    """Four plots over the last `window` s, in the current GUI container."""

    def __init__(self, server: viser.ViserServer, cables: tuple[str, ...], window: float, rate: float, dark: bool):
        self._plots = _layout(cables)
        self._history = History(sum(len(p.labels) for p in self._plots), window, rate)
        self._handles = [_add(server, plot, window, dark) for plot in self._plots]

    def add(self, snapshot: Snapshot) -> None:
        """Remember what is plotted of a snapshot."""
        self._history.add(snapshot.time, np.concatenate([plot.values(snapshot) for plot in self._plots]))

    def draw(self) -> None:
        """Send the curves to the browser."""
        time, *columns = self._history.columns()
        if not len(time):
            return
        for plot, handle in zip(self._plots, self._handles):
            own, columns = columns[: len(plot.labels)], columns[len(plot.labels) :]
            handle.data = (time, *own)


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
        _Plot("tip error, mm", ("model", "truth"), (colours.css(colours.BRAND), colours.css(colours.TRUTH)), errors),
        _Plot("cable tension, N", cables, strokes, tensions),
        _Plot("gravity in soft_base, m/s²", ("x", "y", "z"), _AXES, gravity, 11.0),
        _Plot("delay since the IMU sample, ms", STAGES, _AXES[::-1], delays),
    ]


def _add(server: viser.ViserServer, plot: _Plot, window: float, dark: bool) -> viser.GuiUplotHandle:
    ink, line = ("#aab4c3", "#2b3340") if dark else ("#5b6675", "#e3e8ee")
    axis = {"stroke": ink, "grid": {"stroke": line, "width": 1}, "ticks": {"stroke": line, "width": 1}, "font": "11px sans-serif"}
    series = [{"label": "s"}]
    series += [{"label": label, "stroke": stroke, "width": 1.6, "points": {"show": False}} for label, stroke in zip(plot.labels, plot.strokes)]
    scales = {"x": {"time": False, "range": (-window, 0.0)}}
    if plot.reach is not None:
        scales["y"] = {"range": (-plot.reach, plot.reach)}
    chips = "".join(_chip(label, stroke) for label, stroke in zip(plot.labels, plot.strokes))
    server.gui.add_html(f'<div style="padding:.5em .7em 0;font-size:.82em"><b>{plot.title}</b><br>{chips}</div>')
    return server.gui.add_uplot(
        (np.zeros(1), *(np.full(1, math.nan) for _ in plot.labels)),
        tuple(series),
        scales=scales,
        axes=({"show": False}, {**axis, "size": 42}),
        legend={"show": False},
        cursor={"show": False},
        padding=(6, 10, 6, 0),
        height=120,
    )


def _chip(label: str, stroke: str) -> str:
    box = f'<span style="display:inline-block;width:.85em;height:.25em;border-radius:.1em;background:{stroke};vertical-align:middle"></span>'
    return f'<span style="margin-right:.8em;opacity:.85">{box} {label}</span>'
