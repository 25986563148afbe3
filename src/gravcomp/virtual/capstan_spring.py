"""What the capstans of the virtual robot feel between two steps of its rod, compiled.

Within a step a capstan feels line and rod in series: a stiff line alone would resist every turn as if the rod stood still.

    k' = k / (1 + k c)      k: stiffness of the tendon, c: compliance of its path within one step

The spring k' has the present tension T at the present displacement u, so it becomes slack at u - T / k'.
"""

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def capstan_springs(
    tension: np.ndarray, stiffness: np.ndarray, compliance: np.ndarray, wound: np.ndarray, shortened: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the springs' displacements (m,) m at which they become slack, and their stiffness (m,) N/m.

    tension (m,) N; stiffness (m,) N/m, 0: a broken tendon; compliance (m,) m/N; wound and shortened (m,) m: by how much cable is
    wound in, and by how much its path is shorter than in the unloaded rod. A slack cable becomes taut at the latter.
    """
    contact, spring = shortened.copy(), np.empty_like(stiffness)
    for c in range(len(stiffness)):
        spring[c] = stiffness[c] / (1.0 + stiffness[c] * compliance[c])
        if tension[c] > 0.0 and spring[c] > 0.0:
            contact[c] = wound[c] - tension[c] / spring[c]
    return contact, spring
