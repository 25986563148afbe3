"""Frames of TF as a tree: the rotation of one frame in another, from transforms that come one by one.

R = R_parent(...) R_child,    from the base up to the world
"""

from dataclasses import dataclass

import numpy as np

_SHOWN = 8


@dataclass(frozen=True)
class _Transform:
    """Rotation (3, 3) of a frame in its parent, with its stamp and the time of its arrival (s); static ones do not age."""

    parent: str
    rotation: np.ndarray
    stamp: float
    arrival: float
    static: bool


class FrameTree:
    """Transforms between frames. Attribute: problem, why there is no rotation now; empty where there is one."""

    def __init__(self, base: str, world: str, stale: float):
        """base, world: names of the frames; stale: s after which a transform that is not static is too old."""
        self._base, self._world, self._stale = base, world, stale
        self._frames: dict[str, _Transform] = {}
        self.problem = "no TF is received"

    def take(self, child: str, parent: str, rotation: np.ndarray, stamp: float, arrival: float, *, static: bool) -> None:
        """Take a transform. One that is older than the last one of its frame is not used."""
        before = self._frames.get(child)
        if before is not None and not static and 0.0 < stamp < before.stamp and arrival - before.arrival < self._stale:
            return
        self._frames[child] = _Transform(parent, rotation, stamp, arrival, static)

    def rotation(self, now: float) -> np.ndarray | None:
        """Return the rotation (3, 3) of the base in the world at a time `now` (s, of arrivals), or None; `problem` says why."""
        frame, result, way = self._base, np.eye(3), [self._base]
        while frame != self._world:
            transform = self._frames.get(frame)
            if transform is None:
                known = sorted({*self._frames, *(one.parent for one in self._frames.values())})
                listed = ", ".join(known[:_SHOWN]) + (", ..." if len(known) > _SHOWN else "")
                what = f"'{frame}' has no parent in TF" if frame in known else f"'{frame}' is not in TF"
                there = f"; the frames are {listed}" if known else ""
                self.problem = f"{what}, so '{self._base}' is not connected with '{self._world}'{there}"
                return None
            if not transform.static and now - transform.arrival > self._stale:
                self.problem = f"the transform of '{frame}' in '{transform.parent}' is {now - transform.arrival:.1f} s old"
                return None
            result, frame = transform.rotation @ result, transform.parent
            if frame in way:
                self.problem = f"the frames {', '.join(way)} are a loop in TF: do two nodes publish them?"
                return None
            way.append(frame)
        self.problem = ""
        return result
