"""Folder for results that take long to compute: ~/.cache/gravcomp, under keys made of what they were computed from.

A key is the SHA-256 of the content (robot, mesh, options, format version). A changed input makes a new entry, and no entry can be
stale. The environment variable GRAVCOMP_CACHE names another folder.

    path = cache_path("reduction", content_key(robot, options), ".npz")
"""

import dataclasses
import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np


def cache_folder(kind: str) -> Path:
    """Return the folder of one kind of entry, made when missing."""
    root = os.environ.get("GRAVCOMP_CACHE")
    folder = (Path(root) if root else Path.home() / ".cache" / "gravcomp") / kind
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def cache_path(kind: str, key: str, suffix: str) -> Path:
    """Return the path of one entry, whose file may not exist yet."""
    return cache_folder(kind) / f"{key}{suffix}"


def content_key(*content: Any) -> str:
    """Return a key of 32 hexadecimal digits for data classes, arrays and plain values."""
    digest = hashlib.sha256()
    for item in content:
        if isinstance(item, np.ndarray):
            digest.update(f"{item.dtype}{item.shape}".encode())
            digest.update(np.ascontiguousarray(item).tobytes())
        elif isinstance(item, bytes):
            digest.update(item)
        else:
            plain = dataclasses.asdict(item) if dataclasses.is_dataclass(item) and not isinstance(item, type) else item
            digest.update(json.dumps(plain, sort_keys=True, default=str).encode())
        digest.update(b"\0")
    return digest.hexdigest()[:32]
