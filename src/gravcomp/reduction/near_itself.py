"""Whether the shape of a reduced model brings the robot near itself.

There the full model is used: such shapes are rare, and far from those of the training.
"""

import numpy as np

from gravcomp.contact.own_pairs import may_touch
from gravcomp.full_model.contact import FullContact

# Of the margin within which the full model looks for places: sections that are compressed are a little wider.
_MARGIN = 3.0


class NearItself:
    """Looks at the stations of a reduced model."""

    def __init__(self, contact: FullContact, section_change: np.ndarray):
        """contact: of the full model, with itself; section_change (s, 3, 3, r): changes of its stations' p, f_1, f_2."""
        assert contact.own is not None
        self._surface, self._margin = contact.own.surface, _MARGIN * contact.margin
        r = section_change.shape[-1]
        self._change = np.vstack([np.zeros((3, r)), section_change[:, 0].reshape(-1, r)])
        self._rest = np.concatenate([np.zeros(3), contact.sections_at_rest[:, 0].ravel()])

    def at(self, q: np.ndarray) -> bool:
        """Return whether the robot is near itself at q (r,)."""
        middles = (self._rest + self._change @ q).reshape(-1, 1, 3)
        near: bool = may_touch(self._surface, middles, self._margin)
        return near
