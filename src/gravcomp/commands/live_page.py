"""Starting the viewer, telling people where the live page is, and opening it where there is a screen."""

import argparse
import os
import webbrowser
from typing import TYPE_CHECKING

from gravcomp.commands import output

if TYPE_CHECKING:
    from gravcomp.launcher import Graph, NodeSpec


def add_page_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where the page is served, and whether it is opened."""
    parser.add_argument("--port", type=int, default=8080, help="the viewer's port on this machine (default 8080)")
    parser.add_argument(
        "--no-open", action="store_true", help="only print the page's address, even where a browser could be opened"
    )


def show_page(processes: "Graph", viewer: "NodeSpec", no_open: bool) -> str:
    """Start the node `viewer`, print its page's address, and open it in a graphical session unless `no_open`; returns the address.

    To be called before the other nodes are started: beside all of them the page would take four times as long to come. Raises LaunchError,
    NodeDied, TimeoutError.
    """
    from gravcomp.launcher.page_address import wait_for_page

    processes.start_one(viewer)
    address = wait_for_page(processes)
    output.note(f"The live page: {address}")
    if not no_open and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        webbrowser.open(address)
    return address
