"""Robot files that change a few values of another one, which their key `base` names.

Mappings are merged key by key; lists of mappings by the entries' `name`, `cable` or `can_id`; everything else is replaced. An
empty value (null) removes the key. A section `virtual_robot` with a `description` replaces that of the base as a whole.
"""

import copy
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


def make_paths_whole(document: dict, folder: Path) -> None:
    """Put `folder`, in which the document's relative paths begin, before each of them: body, walls, base, virtual robot."""
    if isinstance(document.get("robot"), dict):
        document["robot"].update(with_whole_path(document["robot"], folder))
    meshes = (document.get("scene") or {}).get("meshes")
    for mesh in meshes if isinstance(meshes, list) else []:
        if isinstance(mesh, dict) and isinstance(mesh.get("file"), str):
            mesh["file"] = str(folder / mesh["file"])
    for mapping, key in ((document, "base"), (document.get("virtual_robot") or {}, "description")):
        if isinstance(mapping.get(key), str) and (folder / mapping[key]).is_file():  # else the name of a shipped robot
            mapping[key] = str(folder / mapping[key])


def on_base(document: dict, base: dict, folder: Path) -> dict:
    """Return the whole document of a file with the key `base`; base: that file's document; folder: where its paths begin."""
    change = {key: value for key, value in document.items() if key != "base"}
    base = copy.deepcopy(base)
    make_paths_whole(base, folder)
    virtual = change.get("virtual_robot")
    if isinstance(virtual, dict) and "description" in virtual:
        base = {key: value for key, value in base.items() if key != "virtual_robot"}
    result = merged(base, change)
    return dict(result)
