"""Texts and figures of the page as HTML."""

import html
import math

from gravcomp.view import colours
from gravcomp.view.snapshot import Snapshot
from gravcomp.view.touches import force_text, resultants

_DOTS = {"ok": "#22c55e", "warn": "#f59e0b", "error": "#ef4444", "off": "#94a3b8"}
_MOTORS = {"active": "ok", "inactive": "off", "unconfigured": "off", "stopped": "error", "fault": "error"}  # other states: warn
_FIGURE = '<div style="flex:1"><div style="font-size:1.35em;font-weight:650;font-variant-numeric:tabular-nums">{}</div>' \
    '<div style="font-size:.74em;opacity:.68">{}</div></div>'  # fmt: skip


def status_html(snapshot: Snapshot, held_at: float | None = None) -> str:
    """Return controller status, motor state, errors and rates.

    held_at: time (s) at which the user began to look back; None for the live state.
    """
    sentence = _sentence(_DOTS.get(snapshot.status_level, _DOTS["off"]), snapshot.status or "waiting for the graph", "status")
    # The model may keep a target while the motors hold, so both states are shown.
    motors = ""
    if snapshot.motors_state:
        state = f"motors {snapshot.motors_state}: "
        text = state + snapshot.motors_message.removeprefix(f"{snapshot.motors_state}: ")
        motors = _sentence(_DOTS[_MOTORS.get(snapshot.motors_state, "warn")], text, "motors")
    figures = [
        (_mm(snapshot.tip_error), "tip to target, model"),
        (_mm(snapshot.true_tip_error), "tip to target, virtual robot"),
    ]
    more = [
        (f"{snapshot.rate:.0f} Hz" if snapshot.rate else "–", "rate of the model"),
        (_ms(snapshot.delays.get("command")), "IMU to command"),
        (_inclination(snapshot), "inclination"),
    ]
    recording = ""
    if snapshot.recording:
        recording = (
            f'<div style="margin-top:.4em;font-size:.8em;color:#ef4444">● recording {html.escape(snapshot.recording)}</div>'
        )
    if held_at is not None:
        recording = (
            f'<div style="margin-top:.4em;font-size:.8em;color:#f59e0b">earlier state: {held_at - snapshot.time:.1f} s ago</div>'
        )
    return (
        f'<div data-time="{snapshot.time:.3f}" data-held-at="{"" if held_at is None else f"{held_at:.3f}"}" '
        f'style="padding:.55em .9em .3em">{sentence}{motors}'
        f'<div style="display:flex;gap:.8em;margin-top:.5em">{_row(figures)}</div>'
        f'<div style="display:flex;gap:.8em;margin-top:.35em">{_row(more)}</div>{recording}</div>'
    )


def _sentence(dot: str, sentence: str, name: str) -> str:
    return (
        '<div style="display:flex;gap:.55em;align-items:baseline">'
        f'<span style="flex:none;width:.68em;height:.68em;border-radius:50%;background:{dot};align-self:center"></span>'
        f'<span data-gravcomp="{name}" style="font-size:.88em">{html.escape(sentence)}</span></div>'
    )


def cables_html(snapshot: Snapshot, names: tuple[str, ...], full: float) -> str:
    """Return one bar per cable in its colour of the scene, and the colour scale, whose end is at the tension `full` (N)."""
    if snapshot.tension is None or snapshot.displacement is None:
        return '<div style="padding:.4em .9em;font-size:.85em;opacity:.7">no model yet</div>'
    rows = []
    for i, name in enumerate(names):
        tension = float(snapshot.tension[i])
        width = min(100.0, 100.0 * tension / full)
        measured = "" if snapshot.motors_tension is None else f"{snapshot.motors_tension[i]:.2f}"
        bar = f"height:100%;border-radius:.3em;width:{width:.0f}%;background:{colours.css(colours.tension_colour(tension, full))}"
        rows.append(
            f'<tr style="white-space:nowrap"><td style="padding-right:.5em">{html.escape(name)}</td><td style="width:34%">'
            f'<div style="height:.62em;border-radius:.3em;background:rgba(128,140,160,.22)"><div style="{bar}"></div></div></td>'
            f'<td style="text-align:right">{tension:.2f} N</td><td style="text-align:right;opacity:.65">{measured}</td>'
            f'<td style="text-align:right">{1e3 * snapshot.displacement[i]:+.2f} mm</td></tr>'
        )
    scale = f"flex:1;height:.55em;border-radius:.3em;background:{colours.tension_gradient()}"
    return (
        '<div style="padding:.3em .9em .5em;font-size:.8em;font-variant-numeric:tabular-nums">'
        f'<table style="width:100%;border-spacing:0 .14em">{"".join(rows)}</table>'
        '<div style="display:flex;align-items:center;gap:.5em;margin-top:.4em;font-size:.92em"><span>slack</span>'
        f'<div style="{scale}"></div><span>{full:g} N</span></div></div>'
    )


def touches_html(snapshot: Snapshot) -> str:
    """Return a table of the forces from outside, on the model and on the virtual robot; empty where nothing touches."""
    model = {touch.source: touch.size for touch in snapshot.model_touches}
    true = {touch.source: touch.size for touch in resultants(snapshot.virtual_touches)}
    rows = [
        f"<tr><td>{html.escape(name)}</td>{_force(model.get(name))}{_force(true.get(name)) if snapshot.virtual else ''}</tr>"
        for name in dict.fromkeys([*model, *true])
    ]
    if snapshot.load is not None:
        text = f"{force_text(snapshot.load.size)} ± {force_text(2.0 * snapshot.load_deviation)}"
        rows.append(f'<tr><td>estimated load at the tip</td><td colspan="2" style="text-align:right">{text}</td></tr>')
    if not rows:
        return ""
    virtual = '<th style="text-align:right;font-weight:400">virtual robot</th>' if snapshot.virtual else ""
    return (
        '<div data-gravcomp="touches" style="padding:.3em .9em .5em;font-size:.8em;font-variant-numeric:tabular-nums">'
        '<table style="width:100%"><tr style="opacity:.68"><th style="text-align:left;font-weight:400">forces from outside</th>'
        f'<th style="text-align:right;font-weight:400">model</th>{virtual}</tr>{"".join(rows)}</table></div>'
    )


def _force(size: float | None) -> str:
    return f'<td style="text-align:right">{"–" if size is None else force_text(size)}</td>'


def legend_html(virtual: bool) -> str:
    """Return the legend of the scene; virtual: there is a virtual robot."""
    entries = [(colours.GHOST, "rest shape"), (colours.TARGET, "target"), (colours.GRAVITY, "gravity")]
    if virtual:
        entries.insert(1, (colours.TRUTH, "ground truth"))
    chips = "".join(
        f'<span style="display:inline-flex;align-items:center;gap:.35em;margin-right:.9em"><span style="width:.7em;height:.7em;'
        f'border-radius:.2em;background:{colours.css(colour)}"></span>{text}</span>'
        for colour, text in entries
    )
    return f'<div style="padding:.35em .9em;font-size:.78em;line-height:1.7">{chips}</div>'


def _row(figures: list[tuple[str, str]]) -> str:
    return "".join(_FIGURE.format(value, meaning) for value, meaning in figures)


def _mm(metres: float) -> str:
    return "–" if not math.isfinite(metres) else f"{1e3 * metres:.2f} mm"


def _ms(seconds: float | None) -> str:
    return "–" if seconds is None or not math.isfinite(seconds) else f"{1e3 * seconds:.1f} ms"


def _inclination(snapshot: Snapshot) -> str:
    if snapshot.gravity is None:
        return "–"
    x, y, z = snapshot.gravity
    return f"{math.degrees(math.atan2(-z, math.hypot(x, y))):+.1f}°"
