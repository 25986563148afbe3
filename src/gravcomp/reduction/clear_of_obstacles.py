"""Whether a robot is clear of all obstacles, so that its steps need no contact: looked at once for all shapes near by."""

from typing import NamedTuple

import numpy as np

from gravcomp.full_model.contact import FullContact
from gravcomp.reduction.free_way import farthest_way, free_way
from gravcomp.scene.world_axes import world_rotation

_LOOKED = 10  # steps with contact between two looks


class _Clear(NamedTuple):
    """A shape q (r,) that is clear of all obstacles by `way` m; rotation (3, 3) of the world and reach of the robot in m then."""

    q: np.ndarray
    rotation: np.ndarray
    way: float
    reach: float


class ClearOfObstacles:
    """Follows one robot. Attribute far: whether nothing was near after the last step."""

    def __init__(self, full: FullContact, section_change: np.ndarray):
        """full: contact of the full model; section_change (s, 3, 3, r): changes of its stations' p, f_1, f_2."""
        self._full, self._change = full, np.ascontiguousarray(section_change.reshape(-1, section_change.shape[-1]))
        self.forget()

    def forget(self) -> None:
        """Forget the shape, for a start from another one."""
        self._clear: _Clear | None = None
        self.far, self._until_look = False, 0

    def look(self, q: np.ndarray, gravity: np.ndarray) -> None:
        """See, once in some steps that nothing was pressed in, whether the robot is far at q (r,) under gravity (3,)."""
        self._until_look -= 1
        if self._until_look <= 0:
            self._until_look = _LOOKED
            self.stays_far(q, q, gravity)

    def stays_far(self, start: np.ndarray, q: np.ndarray, gravity: np.ndarray) -> bool:
        """Return whether on the way from start to q (r,), under gravity (3,), nothing is so near that contact is looked for."""
        full, rotation = self._full, world_rotation(gravity)
        step = farthest_way(full.surface, self._change, q - start)
        if self._clear is not None:
            q_clear, before, way, reach = self._clear
            turned = float(np.linalg.norm(rotation - before)) * (reach + way) if full.scene.in_world.any() else 0.0
            self.far = way > turned + farthest_way(full.surface, self._change, q - q_clear)
            if self.far:
                return True
        sections = full.sections_at_rest + (self._change @ q).reshape(-1, 3, 3)
        reach = float(np.linalg.norm(sections[:, 0], axis=1).max() + 2.0 * full.surface.radius.max())
        way = free_way(full.place(gravity), full.surface, sections) - full.margin
        self._clear, self.far = _Clear(q, rotation, way, reach), way > step
        return self.far
