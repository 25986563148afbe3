"""Telling people where the live page is, and opening it where there is a screen."""

import argparse
import os
import re
import sys
import webbrowser

from gravcomp.launcher import Graph

_PAGE = re.compile(r"the page is at (http://\S+)")
_START_TIMEOUT = 60.0  # s


def add_page_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where the page is served, and whether it is opened."""
    parser.add_argument("--port", type=int, default=8080, help="the viewer's port on this machine (default 8080)")
    parser.add_argument("--no-open", action="store_true", help="only print the page's address, even where a browser could be opened")


def show_page(processes: Graph, no_open: bool) -> str:
    """Wait for the viewer's page, print its address, and open it in a graphical session unless `no_open`; returns the address.

    Raises NodeDied, TimeoutError."""
    log = next(process.log for process in processes.processes.values() if process.spec.executable == "viewer")
    found = None

    def is_served() -> bool:
        nonlocal found
        found = _PAGE.search(log.read_text(errors="replace"))
        return bool(found)

    processes.wait(is_served, _START_TIMEOUT, "the viewer's start")
    print(f"The live page: {found.group(1)}", file=sys.stderr, flush=True)
    if not no_open and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        webbrowser.open(found.group(1))
    return found.group(1)
