"""Address of the live page, read from the viewer's output: the viewer takes the first free port."""

import re

from gravcomp.launcher.graph import Graph

_PAGE = re.compile(r"the page is at (http://\S+)")
_START_TIMEOUT = 60.0  # s


def wait_for_page(processes: Graph, timeout: float = _START_TIMEOUT) -> str:
    """Wait until the page is served. Returns its address. Raises NodeDied, TimeoutError."""
    log = next(process.log for process in processes.processes.values() if process.spec.executable == "viewer")
    found: list[str] = []

    def is_served() -> bool:
        found.extend(_PAGE.findall(log.read_text(errors="replace", encoding="utf-8")))
        return bool(found)

    processes.wait(is_served, timeout, "the start of the viewer")
    return found[0]
