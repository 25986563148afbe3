"""Places and directions of the drawn scene in `soft_base`."""

from collections.abc import Sequence

import numpy as np
import viser

from gravcomp.view.backbone import rotation_from_wxyz
from gravcomp.view.scale import SCALE


class BaseFrame:
    """The frame of the drawn robot's base."""

    def __init__(self, root: viser.FrameHandle) -> None:
        self._root = root

    @property
    def rotation(self) -> np.ndarray:
        """Rotation (3, 3) from soft_base to the drawn scene."""
        return rotation_from_wxyz(self._root.wxyz)

    def place(self, point: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return a point (3,) of the drawn scene in soft_base, m; NaN for what is no point, as a browser may send it."""
        try:
            place = np.asarray(point, dtype=float)
        except (TypeError, ValueError):
            place = np.zeros(0)
        return place @ self.rotation / SCALE if place.shape == (3,) else np.full(3, np.nan)
