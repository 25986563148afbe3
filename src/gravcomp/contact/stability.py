"""Whether a robot would leave an equilibrium in contact; compiled.

With the rows N of what is held (normals of the places that touch, tangents of those that stick, cables that are taut) and T of
forces D T u that turn with the robot, the equilibrium is stable where A - T^T D T is positive definite on the motions with
N u = 0. On these it has

    n(A) + n(diag(0, D^-1) - R A^-1 R^T) - n(D) - rank(N)

negative eigenvalues, where R are the rows of N and T, and n counts negative ones (Sylvester's law of inertia, both Schur
complements of one matrix).
"""

import numpy as np
from numba import njit

AT_LIMIT = 1e-4  # of the limit: friction nearer to it slides
_SOFT = 1e-7  # by how much walls yield, of the compliance of the robot where they hold it


@njit(cache=True)
def leaves(
    negative: int, compliance: np.ndarray, force: np.ndarray, friction: np.ndarray, bend: np.ndarray, wound: np.ndarray,
    given: np.ndarray, c: int,
) -> bool:  # fmt: skip
    """Return whether a motion that the walls allow has a negative stiffness.

    negative: n(A); compliance (k, k): of all rows of `condensed`, with that of the walls; c: number of places; the others are as
    there. A place that slides along one tangent is held along the other.
    """
    m, index, count = len(wound), np.empty(len(force), dtype=np.int64), 0
    for a in range(m):
        if not len(given) and np.isfinite(wound[a]) and force[a] > 0.0:
            index[count] = a
            count += 1
    for i in range(c):
        if force[m + i] <= 0.0:
            continue
        index[count] = m + i
        count += 1
        if len(friction):
            for k in range(m + c + 2 * i, m + c + 2 * i + 2):
                if abs(force[k]) < (1.0 - AT_LIMIT) * friction[i] * force[m + i]:
                    index[count] = k
                    count += 1
    for a in range(len(force) - len(bend), len(force)):
        index[count] = a
        count += 1
    block = np.empty((count, count))
    for i in range(count):
        for j in range(count):
            block[i, j] = compliance[index[i], index[j]]
    return unstable_motions(negative, block, bend) > 0


@njit(cache=True)
def unstable_motions(negative: int, compliance: np.ndarray, turning: np.ndarray) -> int:
    """Return how many motions, which the walls allow, have a negative stiffness.

    negative: n(A); compliance (k, k): R A^-1 R^T, rows of N first; turning (t,): D of the last rows, none of which is 0. Rows of
    N may depend on each other, as those of a face on a plane do: with walls that yield a little, each of them counts.
    """
    rows = len(compliance)
    held = rows - len(turning)
    inner, size, below = np.empty((rows, rows)), np.empty(rows), 0
    for i in range(rows):
        own = -compliance[i, i] + (1.0 / turning[i - held] if i >= held else 0.0)
        # Scaling changes no sign. Without it, the rounding error of the entry of a force that is nearly 0 hides all others.
        size[i] = 1.0 / abs(turning[i - held]) if i >= held else (abs(own) if own != 0.0 else 1.0)  # 0 at the clamp
        inner[i, i] = own / size[i] - (_SOFT if i < held else 0.0)
        below += i >= held and turning[i - held] < 0.0
    for i in range(rows):
        for j in range(i):
            inner[i, j] = inner[j, i] = -0.5 * (compliance[i, j] + compliance[j, i]) / np.sqrt(size[i] * size[j])
    return negative + (np.linalg.eigvalsh(inner) < 0.0).sum() - below - held
