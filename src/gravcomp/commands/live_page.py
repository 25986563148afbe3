"""Start the viewer, print the address of the live page, and open the page in a graphical session."""

import argparse
import os
import webbrowser
from typing import TYPE_CHECKING

from gravcomp.commands import output
from gravcomp.commands.parsers import in_range

if TYPE_CHECKING:
    from gravcomp.launcher import Graph


def add_page_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the page's port and whether a browser is opened."""
    parser.add_argument(
        "--port", type=in_range(int, 1, 65535), default=8080, help="port of the live page on this machine (default: 8080)"
    )
    parser.add_argument("--no-open", action="store_true", help="print the address of the page, but open no browser")


def show_page(processes: "Graph", no_open: bool) -> str:
    """Print the address of the page of the node `viewer`, which has been started; open it in a graphical session.

    `no_open`: open no browser. Returns the address. Start the viewer before the other nodes: its imports take longest.
    Raises NodeDied, TimeoutError.
    """
    from gravcomp.launcher.page_address import wait_for_page

    address = wait_for_page(processes)
    output.note(f"The live page: {address}")
    if not no_open and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        webbrowser.open(address)
    return address
