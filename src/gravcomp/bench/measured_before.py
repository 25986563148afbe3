"""What a benchmark of robots has measured before, kept under the content of what was measured and of the program.

A result is measured again when the robot, a file that it names, or the source of the core has changed. So a benchmark that was
interrupted goes on where it stopped.
"""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from gravcomp.cache import cache_path, content_key
from gravcomp.whole_file import write_whole

_PACKAGE = Path(__file__).parents[1]


def place_of(*content: Any) -> Path:
    """Return the path of the result for this content and this program, whose file may not exist yet."""
    return cache_path("bench", content_key(_sources(), *content), ".json")


def measured_before(path: Path, measure: Callable[[], dict[str, Any]], *, again: bool) -> dict[str, Any]:
    """Return what `measure` returned earlier for this path, or measure and keep it; again: measure in any case.

    A result with the key `error` is not kept: it may lie in what the path does not stand for, as an installed library.
    """
    if path.exists() and not again:
        known: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return known
    found = measure()
    if "error" not in found:
        write_whole(path, json.dumps(found))
    return found


@cache
def _sources() -> str:
    """Key of the sources of the core."""
    return content_key(*(path.read_bytes() for path in sorted(_PACKAGE.rglob("*.py"))))
