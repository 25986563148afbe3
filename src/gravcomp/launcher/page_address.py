"""Where the viewer of a starting graph serves its page: the first free port is known to it alone, and it says so in its output."""

import re

from gravcomp.launcher.graph import Graph

_PAGE = re.compile(r"the page is at (http://\S+)")
_START_TIMEOUT = 60.0  # s


def wait_for_page(processes: Graph, timeout: float = _START_TIMEOUT) -> str:
    """The page's address, once it is served. Raises NodeDied, TimeoutError."""
    log = next(process.log for process in processes.processes.values() if process.spec.executable == "viewer")
    found: list[str] = []

    def is_served() -> bool:
        found.extend(_PAGE.findall(log.read_text(errors="replace")))
        return bool(found)

    processes.wait(is_served, timeout, "the viewer's start")
    return found[0]
