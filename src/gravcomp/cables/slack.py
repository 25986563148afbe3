"""Which cables are taut: complementarity of tension and slack.

A cable wound in by u allows a path no longer than L_0 - u. With the linear answer delta = W lambda + delta_free,

    lambda >= 0,    s = W lambda + delta_free - u >= 0,    lambda s = 0.

W is positive definite, so there is exactly one solution; principal pivoting on the least index finds it in finitely many
steps (Murty 1974), and starting from the last taut set it mostly takes one.
"""

import numpy as np
from numba import njit

_SMALL = 1e-12  # m, of slack that is rounding


def taut_tensions(compliance: np.ndarray, free: np.ndarray, wound: np.ndarray, taut: np.ndarray | None = None) -> np.ndarray:
    """Tensions (m,) in N of cables wound in by `wound` (m,) in m; NaN there means released.

    compliance (m, m) in m/N; free (m,) displacements without tension in m; taut (m,) the guess of which are taut.
    """
    held = ~np.isnan(wound)
    guess = held & taut if taut is not None else np.zeros(len(free), dtype=np.bool_)
    return pivoted(np.ascontiguousarray(compliance), np.where(held, wound - free, 0.0), held, guess)


@njit(cache=True)
def pivoted(compliance: np.ndarray, lack: np.ndarray, held: np.ndarray, taut: np.ndarray) -> np.ndarray:
    """Tensions (m,) for the displacements lacking (m,); only what is `held` (m,) can be taut; the guess `taut` (m,) is changed."""
    m = len(lack)
    tension = np.zeros(m)
    for _ in range(50 + 2**m):
        chosen = np.flatnonzero(taut)
        block, right = np.empty((len(chosen), len(chosen))), np.empty(len(chosen))
        for a, i in enumerate(chosen):
            right[a] = lack[i]
            for b, j in enumerate(chosen):
                block[a, b] = compliance[i, j]
        tension[:] = 0.0
        if len(chosen):
            solved = np.linalg.solve(block, right)
            for a, i in enumerate(chosen):
                tension[i] = solved[a]
        wrong = -1
        for i in range(m):
            slack = compliance[i] @ tension - lack[i]
            if tension[i] < 0.0 if taut[i] else held[i] and slack < -_SMALL:
                wrong = i
                break
        if wrong < 0:
            break
        taut[wrong] = not taut[wrong]
    return tension
