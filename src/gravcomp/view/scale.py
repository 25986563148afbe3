"""Scale of the scene."""

import numpy as np

# Robots are drawn ten times as large, because cameras, shadows and handles are made for scenes of some metres.
SCALE = 10.0


def scaled(points: np.ndarray) -> np.ndarray:
    """Return points in m as points of the scene, float32."""
    return np.asarray(SCALE * points, np.float32)
