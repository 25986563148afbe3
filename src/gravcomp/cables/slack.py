"""Complementarity of tension and slack: decides which cables are taut.

A cable that is pulled in by u allows a path no longer than L_0 - u. With the linear response delta = W lambda + delta_free,

    lambda >= 0,    s = W lambda + delta_free - u >= 0,    lambda s = 0.

W is positive definite, so there is exactly one solution. Principal pivoting with the least index finds it in finitely many steps
(Murty 1974); started from the last taut set it usually takes one.
"""

import numpy as np
from numba import njit

_SMALL = 1e-12  # m of slack that is rounding error


def taut_tensions(compliance: np.ndarray, free: np.ndarray, wound: np.ndarray, taut: np.ndarray | None = None) -> np.ndarray:
    """Return the tensions (m,) in N of cables that are pulled in by `wound` (m,) in m; NaN: released.

    compliance (m, m) in m/N; free (m,): displacements without tension in m; taut (m,): first guess of the taut cables.
    """
    held = ~np.isnan(wound)
    guess = held & taut if taut is not None else np.zeros(len(free), dtype=np.bool_)
    return pivoted(np.ascontiguousarray(compliance), np.where(held, wound - free, 0.0), held, guess)


@njit(cache=True)
def pivoted(compliance: np.ndarray, lack: np.ndarray, held: np.ndarray, taut: np.ndarray) -> np.ndarray:
    """Return the tensions (m,) in N.

    lack (m,): missing displacement in m; held (m,): cables that can be taut; taut (m,): first guess, overwritten with the result.
    """
    m = len(lack)
    tension = np.zeros(m)
    for _ in range(50 + 2**m):
        chosen = np.flatnonzero(taut)
        block, right = np.empty((len(chosen), len(chosen))), np.empty(len(chosen))
        for a in range(len(chosen)):
            right[a] = lack[chosen[a]]
            for b in range(len(chosen)):
                block[a, b] = compliance[chosen[a], chosen[b]]
        tension[:] = 0.0
        if len(chosen):
            solved = np.linalg.solve(block, right)
            for a in range(len(chosen)):
                tension[chosen[a]] = solved[a]
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
