"""Message definitions for bags, from the .msg files of the installed packages.

ROS installs them as `<prefix>/share/PACKAGE/msg/NAME.msg` for each prefix in AMENT_PREFIX_PATH. The hash is that of REP-2016,
which `ros2 bag` compares with the types of the running graph.
"""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from gravcomp.recordings.bags.errors import BagError


class Definitions:
    """Definitions by type name ('sensor_msgs/msg/Imu'), read at their first use."""

    def __init__(self, prefixes: list[Path] | None = None):
        """prefixes: folders of installed packages; default: AMENT_PREFIX_PATH."""
        if prefixes is None:
            prefixes = [Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if p]
        self._prefixes = prefixes
        self._store = get_typestore(Stores.EMPTY)

    def of(self, name: str) -> tuple[str, str]:
        """Return the definition, including the types it uses, and the hash. Raises BagError for a type that is not installed."""
        self._add(name)
        return self._store.generate_msgdef(name, ros_version=2)[0], self._store.hash_rihs01(name)

    def add_text(self, name: str, text: str) -> None:
        """Add the types of a definition from a bag."""
        self._store.register(
            {key: value for key, value in get_types_from_msg(text, name).items() if key not in self._store.fielddefs}
        )

    def _add(self, name: str) -> None:
        if name in self._store.fielddefs:
            return
        types = get_types_from_msg(self._text(name), name)
        for needed in sorted(_named(types[name][1])):
            self._add(needed)
        self._store.register({name: types[name]})

    def _text(self, name: str) -> str:
        package, _, message = name.split("/")
        for prefix in self._prefixes:
            path = prefix / "share" / package / "msg" / f"{message}.msg"
            if path.is_file():
                return path.read_text(encoding="utf-8")
        raise BagError(f"the type {name} is not installed: no share/{package}/msg/{message}.msg in any of AMENT_PREFIX_PATH")


def _named(fields: Iterable[tuple[str, Any]]) -> set[str]:
    """Return the names of all message types in the descriptions of fields."""
    found = set()
    for _, (kind, what) in fields:
        if kind.name in ("ARRAY", "SEQUENCE"):
            kind, what = what[0]
        if kind.name == "NAME":
            found.add(what)
    return found
