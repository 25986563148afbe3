"""Contact forces, friction and cable tensions from the compliance of the body at the cables and at the places of contact.

With the linear response v = S f + v_free of the rows

    0 ... m - 1      cables: displacement, tension
    m ... m + c - 1  normal directions of the places
    2 c rows         tangents `around` and `along` of each place (only with friction)
    e rows           directions in which the normal forces turn or move with the body

the forces satisfy

    cable:    lambda >= 0,   s = v - wound >= 0,                 lambda s = 0
    normal:   lambda >= 0,   s = gap + v + c lambda >= 0,        lambda s = 0      (c: compliance of a wall that yields)
    friction: |t| <= mu lambda;  v_t = 0 if less, else t = -mu lambda v_t / |v_t|

with v_t counted from the last equilibrium. Where an obstacle is curved, a normal force turns when the middle of the section moves
along the tangent `around`: D = lambda x curvature. Where the gap has a minimum along the robot, the place of the force moves
when the robot tilts there: D = -lambda / g''. These forces D v on the last rows are eliminated first.

For given limits of friction, along and across the direction in which a place pulls or slides, this is a quadratic programme with
bounds, min f^T S f / 2 + f^T v over tensions, normal forces and friction together. It is solved by a set of states, free or at a
bound: a linear solve, after which every wrong state changes at once (J. Judice, F. Pires, 1994); when that does not make the
wrong states fewer, one at a time (K. G. Murty, 1974), which ends for every positive definite S. Limits and directions follow
from the normal forces and motions found, in a few rounds (P. Panagiotopoulos, 1975). The number of solves is bounded.
"""

import numpy as np
from numba import njit

OPEN, STICKING, SLIDING = 0, 1, 2
_SOFT = 1e-7  # of the mean compliance of the normals: shares the force among places that the model cannot move on their own
_PATIENCE, _MOST = 6, 200  # solves without fewer wrong states before one at a time changes; solves in all
_SMALL = 1e-12  # m of slack that is rounding error
_ROUNDS, _AGREED, _NEARLY = 15, 1e-6, 1e-2  # rounds of friction limits; their change, of the largest, that ends them or will do


@njit(cache=True)
def contact_forces(
    compliance: np.ndarray, free: np.ndarray, wound: np.ndarray, given: np.ndarray, taut: np.ndarray, gap: np.ndarray,
    yielding: np.ndarray, friction: np.ndarray, bend: np.ndarray, rub: np.ndarray, state: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, bool]:  # fmt: skip
    """Return the forces (k,) of all rows, their changes (k, m) by the tensions, and whether all conditions hold.

    compliance S (k, k) and free (k,): of the response. wound (m,): displacement to which each cable is pulled in, NaN: released;
    given (m,): tensions, which take precedence, or (0,); taut (m,): first guess. gap (c,) in m; yielding (c,): m/N of the walls;
    friction (c,): coefficients, (0,) where there are no rows of friction; bend (e,): D in N/m; rub (c, 2): friction in N and
    state (c,): first guesses, the latter overwritten with the result. The changes by the tensions hold the places that
    touch in contact, and those that stick at rest.
    """
    m, c = len(wound), len(gap)
    rubbing = len(friction) > 0
    rows = m + (3 * c if rubbing else c)
    extra = len(bend)
    w, q, turned = compliance[:rows, :rows].copy(), free[:rows].copy(), np.zeros((extra, rows + 1))
    if extra:  # eliminate the last rows
        own = np.ascontiguousarray(compliance[rows:, rows:])
        if bend.max() > 0.0 and not _stable(own, bend):
            bend = np.minimum(bend, 0.0)
        turned[:, :rows], turned[:, rows] = compliance[rows:, :rows], free[rows:]
        turned = np.linalg.solve(np.eye(extra) - own * bend, turned)
        for i in range(extra):
            turned[i] *= bend[i]
        middle = np.ascontiguousarray(compliance[:rows, rows:])
        w += middle @ np.ascontiguousarray(turned[:, :rows])
        q += middle @ np.ascontiguousarray(turned[:, rows])
    soft = 0.0
    for i in range(c):
        soft += _SOFT * compliance[m + i, m + i] / c
    for i in range(m, rows):
        w[i, i] += soft
    for i in range(c):
        w[m + i, m + i] += yielding[i]
        q[m + i] += gap[i]
    force = np.zeros(rows)
    low, high = np.full(rows, -np.inf), np.full(rows, np.inf)
    side = np.zeros(rows, dtype=np.int64)
    for a in range(m):
        if len(given):
            low[a] = high[a] = force[a] = given[a]
        elif np.isfinite(wound[a]):
            low[a] = 0.0
            q[a] -= wound[a]
            side[a] = 0 if taut[a] else -1
        else:
            low[a] = high[a] = 0.0
    for i in range(c):
        low[m + i] = 0.0
        side[m + i] = -1 if state[i] == OPEN else 0
    if rubbing:
        settled = _rub(w, q, m, c, friction, rub, low, high, side, force, state)
    else:
        settled = _bounded(w, q, low, high, side, force)
    for i in range(c):
        k = m + c + 2 * i
        if side[m + i]:
            state[i] = OPEN
        else:
            state[i] = STICKING if rubbing and high[k] > 0.0 and not side[k] and not side[k + 1] else SLIDING
    # Changes by the tensions.
    held = _held(m, c, rubbing, state)
    change = np.zeros((rows, m))
    for a in range(m):
        change[a, a] = 1.0
    if len(held):
        block, right = np.empty((len(held), len(held))), np.empty((len(held), m))
        for i in range(len(held)):
            for j in range(len(held)):
                block[i, j] = w[held[i], held[j]]
            right[i] = -w[held[i], :m]
        solved = np.linalg.solve(block, right)
        for i in range(len(held)):
            change[held[i]] = solved[i]
    whole, changes = np.empty(rows + extra), np.empty((rows + extra, m))
    whole[:rows] = force
    changes[:rows] = change
    if extra:
        part = np.ascontiguousarray(turned[:, :rows])
        whole[rows:] = part @ force + turned[:, rows]
        changes[rows:] = part @ change
    return whole, changes, settled


@njit(cache=True)
def _stable(compliance: np.ndarray, bend: np.ndarray) -> bool:
    """Whether the body at the middles, with the forces that turn with convex obstacles, still resists: S^-1 - D is positive."""
    c = len(bend)
    softer = np.empty((c, c))
    for i in range(c):
        for j in range(c):
            softer[i, j] = -np.sqrt(max(bend[i], 0.0) * max(bend[j], 0.0)) * compliance[i, j]
        softer[i, i] += 1.0
    return np.linalg.eigvalsh(softer)[0] > 0.05


@njit(cache=True)
def _held(m: int, c: int, rubbing: bool, state: np.ndarray) -> np.ndarray:
    """Return the rows that are held in contact and at rest."""
    held = np.empty(3 * c, dtype=np.int64)
    count = 0
    for i in range(c):
        if state[i] != OPEN:
            held[count] = m + i
            count += 1
            if rubbing and state[i] == STICKING:
                held[count], held[count + 1] = m + c + 2 * i, m + c + 2 * i + 1
                count += 2
    return held[:count]


@njit(cache=True)
def _rub(
    w: np.ndarray, q: np.ndarray, m: int, c: int, friction: np.ndarray, rub: np.ndarray, low: np.ndarray, high: np.ndarray,
    side: np.ndarray, force: np.ndarray, state: np.ndarray,
) -> bool:  # fmt: skip
    """Find forces with friction; returns whether limits and normal forces agree. rub (c, 2): first guess of the friction."""
    limit, direction = np.zeros((c, 2)), np.zeros((c, 2))
    for i in range(c):
        pull, k = np.hypot(rub[i, 0], rub[i, 1]), m + c + 2 * i
        for v in range(2):
            direction[i, v] = abs(rub[i, v]) / pull if pull > 0.0 else np.sqrt(0.5)
            limit[i, v] = pull * direction[i, v] if friction[i] > 0.0 else 0.0
            side[k + v] = 0 if state[i] == STICKING or pull == 0.0 else (1 if rub[i, v] > 0.0 else -1)
    change = np.inf
    for _ in range(_ROUNDS):
        for i in range(c):
            for v in range(2):
                k = m + c + 2 * i + v
                high[k], low[k] = limit[i, v], -limit[i, v]
        if not _bounded(w, q, low, high, side, force):
            return False
        response = q + w @ force
        change, largest = 0.0, 0.0
        for i in range(c):
            k = m + c + 2 * i
            most = friction[i] * max(force[m + i], 0.0)
            toward = force[k : k + 2] if not side[k] and not side[k + 1] else response[k : k + 2]
            size = np.hypot(toward[0], toward[1])
            for v in range(2):
                if size > _SMALL * 1e-3:
                    direction[i, v] = 0.5 * (direction[i, v] + abs(toward[v]) / size)
            norm = np.hypot(direction[i, 0], direction[i, 1])
            for v in range(2):
                following = most * direction[i, v] / norm
                change, largest = max(change, abs(following - limit[i, v])), max(largest, most)
                limit[i, v] = following
        if change <= _AGREED * largest:
            return True
        change /= max(largest, 1e-300)
    return change <= _NEARLY


@njit(cache=True)
def _bounded(w: np.ndarray, q: np.ndarray, low: np.ndarray, high: np.ndarray, side: np.ndarray, force: np.ndarray) -> bool:
    """Minimise f^T w f / 2 + q^T f within bounds; returns whether the minimum is found.

    low, high (n,); side (n,): -1 at the low bound, 1 at the high one, 0 between: a guess, overwritten; force (n,): the result.
    """
    n = len(q)
    index = np.empty(n, dtype=np.int64)
    fewest, waited, single = n + 1, 0, False
    for _ in range(_MOST):
        count = 0
        for a in range(n):
            if low[a] == high[a]:
                force[a] = low[a]
            elif side[a] == 0:
                index[count] = a
                count += 1
                force[a] = 0.0
            else:
                force[a] = low[a] if side[a] < 0 else high[a]
        known = q + w @ force
        if count:
            block, right = np.empty((count, count)), np.empty(count)
            for a in range(count):
                right[a] = -known[index[a]]
                for b in range(count):
                    block[a, b] = w[index[a], index[b]]
            solved = np.linalg.solve(block, right)
            for a in range(count):
                force[index[a]] = solved[a]
            known = q + w @ force
        wrong, scale = 0, np.abs(force).max() * 1e-12
        for a in range(n):
            if low[a] == high[a]:
                continue
            following = side[a]
            if side[a] == 0:
                if force[a] < low[a] - scale:
                    following = -1
                elif force[a] > high[a] + scale:
                    following = 1
            elif (side[a] < 0 and known[a] < -_SMALL) or (side[a] > 0 and known[a] > _SMALL):
                following = 0
            if following != side[a]:
                if not (single and wrong):
                    side[a] = following
                wrong += 1
        if not wrong:
            return True
        if wrong < fewest:
            fewest, waited = wrong, 0
        else:
            waited += 1
            single |= waited > _PATIENCE
    return False
