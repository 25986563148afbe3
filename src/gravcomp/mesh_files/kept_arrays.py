"""Nodes and cells that take long to compute, kept in a file."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.whole_file import write_whole


def kept(path: Path, computed: Callable[[], tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and cells from the file, or as they are computed, and then stored there."""
    if path.exists():
        with np.load(path) as content:
            return content["nodes"], content["cells"]
    nodes, cells = computed()
    content = io.BytesIO()
    np.savez(content, nodes=nodes, cells=cells)
    write_whole(path, content.getvalue())
    return nodes, cells
