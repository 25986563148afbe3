"""The live page in a headless browser: time until it is drawn, update rate, and its effect on the delay of the loop.

Without a graphics chip the browser draws on the CPU that also runs the loop, so the figures depend on the machine; `graphics`
states which graphics were used.
"""

import time
from collections.abc import Callable

import numpy as np

from gravcomp.evaluation.bus_delay import DelayListener
from gravcomp.launcher.virtual_graph import RunningGraph
from gravcomp.view.browser import Browser, find_chromium
from gravcomp.view.graphics import chosen

_LIGHT = {"virtual_robot": {"feedback_rate": 125, "motion": "tremor", "truth_rate": 50.0}}  # as in the demo
_FIRST_TRACE = 60.0  # s, longest wait for the first command on the bus
_FRAMES = "window.gravcompFrames = 0; (function count() { window.gravcompFrames++; requestAnimationFrame(count) })()"


def run(
    progress: Callable[[str], None], *, listen: float = 20.0, settle: float = 5.0, window: tuple[int, int] = (1600, 900)
) -> dict:
    """Return the figures of the page.

    `drawn_s`: from the start of all nodes until an open browser has drawn the page; `updates_hz`: updates sent to the page;
    `animation_hz`: frames drawn by the browser; `delay_ms` of the loop, median and p99: `without` a viewer, `served` without an
    open page, `looked_at` with one. listen: duration (s) of each measurement; settle: time (s) before it;
    window: of the browser, width and height in px.
    """
    if find_chromium() is None:
        return {"page": "no Chromium on this machine: apt-get install chromium"}
    delays = {}
    with RunningGraph(_LIGHT) as graph:
        progress("the loop without a viewer")
        graph.wait_for_commands()
        delays["without"] = _delays(graph, settle, listen)
    with Browser(*window) as browser:
        begin = time.monotonic()
        with RunningGraph(_LIGHT, viewer=True) as graph:
            progress("start of the page")
            served = time.monotonic() - begin
            browser.open(graph.page)
            drawn = time.monotonic() - begin
            progress("the page open")
            graph.wait_for_commands()
            time.sleep(settle)
            browser.page.evaluate(_FRAMES)
            received, frames, since = browser.received, browser.page.evaluate("window.gravcompFrames"), time.monotonic()
            delays["looked_at"] = _delays(graph, settle, listen)
            frames = browser.page.evaluate("window.gravcompFrames") - frames
            elapsed = time.monotonic() - since
            updates = (browser.received - received) / elapsed
            progress("the page not open")
            browser.page.goto("about:blank")
            delays["served"] = _delays(graph, settle, listen)
            graph.check()
    return {
        "robot": "virtual robot",
        "graphics": chosen("auto"),
        "served_s": round(served, 2),
        "drawn_s": round(drawn, 2),
        "updates_hz": round(updates, 1),
        "animation_hz": round(frames / elapsed, 1),
        "delay_ms": delays,
    }


def _delays(graph: RunningGraph, settle: float, duration: float) -> dict[str, float]:
    time.sleep(settle)
    listener = DelayListener(graph.can)
    listener.start()
    end = time.monotonic() + _FIRST_TRACE
    while not listener.delays and time.monotonic() < end:
        time.sleep(0.1)
    time.sleep(duration)
    listener.stop()
    in_ms = 1e3 * np.array(listener.delays)
    if not len(in_ms):
        raise TimeoutError(listener.failure or "no command was traced on the bus while listening")
    return {"median": round(float(np.median(in_ms)), 2), "p99": round(float(np.percentile(in_ms, 99)), 2)}
