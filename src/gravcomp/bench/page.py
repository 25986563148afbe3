"""The live page in a real browser, headless: how soon it is drawn, how often it is renewed, and what it costs the loop.

Without a graphics chip the browser draws with the processor that the loop runs on; that is a property of this machine and told with it.
"""

import time
from collections.abc import Callable

import numpy as np

from gravcomp.evaluation.bus_delay import DelayListener
from gravcomp.launcher.virtual_graph import RunningGraph
from gravcomp.view.browser import Browser, find_chromium
from gravcomp.view.graphics import chosen

_LIGHT = {"virtual_robot": {"feedback_rate": 125, "motion": "tremor", "truth_rate": 50.0}}  # as the demo's
_SETTLE = 5.0  # s
_FRAMES = "window.gravcompFrames = 0; (function count() { window.gravcompFrames++; requestAnimationFrame(count) })()"


def run(progress: Callable[[str], None], *, listen: float = 20.0) -> dict:
    """`drawn_s`: from the start of all nodes until the page is drawn in a browser that is open already; `updates_hz`: what the page is sent a second; `animation_hz`: what the
    browser draws at most; `delay_ms` of the loop, median and p99, `without` a viewer, `served` but looked at by nobody, `looked_at`.
    """
    if find_chromium() is None:
        return {"page": "no Chromium on this machine: apt-get install chromium"}
    delays = {}
    with RunningGraph(_LIGHT) as graph:
        progress("the loop without a viewer")
        graph.wait_for_commands()
        delays["without"] = _delays(graph, listen)
    with Browser() as browser:
        begin = time.monotonic()
        with RunningGraph(_LIGHT, viewer=True) as graph:
            progress("the page's start")
            served = time.monotonic() - begin
            browser.open(graph.page)
            drawn = time.monotonic() - begin
            progress("the page looked at")
            graph.wait_for_commands()
            time.sleep(_SETTLE)
            browser.page.evaluate(_FRAMES)
            received, frames, since = browser.received, browser.page.evaluate("window.gravcompFrames"), time.monotonic()
            delays["looked_at"] = _delays(graph, listen)
            frames = browser.page.evaluate("window.gravcompFrames") - frames
            elapsed = time.monotonic() - since
            updates = (browser.received - received) / elapsed
            progress("the page served, looked at by nobody")
            browser.page.goto("about:blank")
            delays["served"] = _delays(graph, listen)
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


def _delays(graph: RunningGraph, duration: float) -> dict[str, float]:
    time.sleep(_SETTLE)
    listener = DelayListener(graph.can)
    listener.start()
    time.sleep(duration)
    listener.stop()
    in_ms = 1e3 * np.array(listener.delays)
    if not len(in_ms):
        raise TimeoutError(listener.failure or "no command was traced on the bus while listening")
    return {"median": round(float(np.median(in_ms)), 2), "p99": round(float(np.percentile(in_ms, 99)), 2)}
