"""Robot files that change a few values of another one, which their key `base` names.

Mappings are merged key by key; lists of mappings by the entries' `name`, `cable` or `can_id`; everything else is replaced. An
empty value (null) removes the key. A section `virtual_robot` with a `description` replaces that of the base as a whole.
"""

from pathlib import Path
from typing import Any

_NAMES = ("name", "cable", "can_id")
"""Keys by which entries of lists are known, the first that all of them have and that differs from entry to entry."""


def merged(base: Any, change: Any) -> Any:
    """Return the value `base` with `change`; neither is altered."""
    if isinstance(base, dict) and isinstance(change, dict):
        result = {key: value for key, value in base.items() if key not in change or change[key] is not None}
        return result | {key: merged(base.get(key), value) for key, value in change.items() if value is not None}
    if isinstance(base, list) and isinstance(change, list):
        key = _key_of(base, change)
        if key is not None:
            changes = {entry[key]: entry for entry in change}
            kept = [merged(entry, changes.pop(entry[key], {})) for entry in base]
            return [*kept, *changes.values()]
    return change


def _key_of(*lists: list) -> str | None:
    """Return the key that names the entries of all lists, None: they have none."""
    for key in _NAMES:
        if not all(isinstance(entry, dict) and isinstance(entry.get(key), str | int) for one in lists for entry in one):
            continue
        if all(len({entry[key] for entry in one}) == len(one) for one in lists):
            return key
    return None


def with_whole_path(section: Any, folder: Path) -> Any:
    """Return the section `robot` with the path of the body's file, which is relative to the robot file's folder."""
    body = section.get("body") if isinstance(section, dict) else None
    if not isinstance(body, dict) or not isinstance(body.get("file"), str):
        return section
    return {**section, "body": {**body, "file": str(folder / body["file"])}}


def on_base(document: dict, base: dict, folder: Path) -> dict:
    """Return the whole document of a file with the key `base`; base: that file's document; folder: where its paths begin."""
    change = {key: value for key, value in document.items() if key != "base"}
    if "robot" in base:
        base = {**base, "robot": with_whole_path(base["robot"], folder)}
    meshes = (base.get("scene") or {}).get("meshes")
    if isinstance(meshes, list):
        whole = [
            {**mesh, "file": str(folder / mesh["file"])} if isinstance(mesh, dict) and isinstance(mesh.get("file"), str) else mesh
            for mesh in meshes
        ]
        base = {**base, "scene": {**base["scene"], "meshes": whole}}
    origin = (base.get("virtual_robot") or {}).get("description")
    if isinstance(origin, str) and (folder / origin).is_file():
        base = {**base, "virtual_robot": {**base["virtual_robot"], "description": str(folder / origin)}}
    virtual = change.get("virtual_robot")
    if isinstance(virtual, dict) and "description" in virtual:
        base = {key: value for key, value in base.items() if key != "virtual_robot"}
    result = merged(base, change)
    return dict(result)
