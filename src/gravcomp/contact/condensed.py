"""Contact forces, friction and cable tensions from the compliance of the body at the cables and at the places of contact.

With the linear response v = S f + v_free of the rows

    0 ... m - 1      cables: displacement, tension
    m ... m + c - 1  normal directions of the places
    2 c rows         tangents `around` and `along` of each place (only with friction)
    e rows           directions in which the normal forces turn or move with the body

the forces satisfy

    cable:    lambda >= 0,   s = v - wound >= 0,                 lambda s = 0
    normal:   lambda >= 0,   s = gap + v + c lambda >= 0,        lambda s = 0      (c: compliance of a wall that yields)
    friction: |t| <= mu lambda along each tangent;  v_t = 0 if less, else against t

with v_t counted from the last equilibrium. Where an obstacle is curved, a normal force turns when the middle of the section moves
along the tangent `around`: D = lambda x curvature. Where the gap has a minimum along the robot, the place of the force moves
when the robot tilts there: D = -lambda / g''. These forces D v on the last rows are eliminated first.

The limits are those of a pyramid around Coulomb's cone: exact along the two tangents, up to the root of 2 too large between them.
With given limits the conditions are those of a quadratic programme with bounds, min f^T S f / 2 + f^T v over tensions, normal
forces and friction together. Its states, at a bound or between, are changed all at once, with one linear solve for each change
(J. Judice, F. Pires, 1994), and one at a time, the last wrong one, where that leaves as many wrong ones (K. Murty, 1974). Where
that does not end, sweeps over the forces and Newton steps of those between their bounds, clipped and halved until they lower the
sum, find them (J. More, G. Toraldo, SIAM J. Optim. 1, 1991, with sweeps for gradient steps). The limits follow from the normal
forces found, in a few rounds (P. Panagiotopoulos, 1975). Where two places take the force from one another in turns, a part of
each change is taken (B. Irons, R. Tuck, 1969). The number of solves is bounded.

Next to convex obstacles D is positive, and the robot may be balanced as on top of a ball. Where the forces that turn overcome
the stiffness, they are left out: the steps then lead away from such a shape. It is no solution where it would be left.
"""

import numpy as np
from numba import njit

from gravcomp.contact.stability import AT_LIMIT, leaves

OPEN, STICKING, SLIDING = 0, 1, 2
_SOFT = 1e-7  # of the mean compliance of the normals: shares the force among places that the model cannot move on their own
_SWITCHES, _PATIENCE = 40, 4  # changes of wrong states; those of all at once that may leave as many wrong ones as before
_STEPS, _SWEEPS, _HALVES = 200, 3, 30  # steps that lower the sum, sweeps before each, halvings of one
_STIFF = 1e-2  # of the stiffness that forces which turn have to leave, to be part of a step
_RUNAWAY = 2.0  # of the largest force: growth in a step along which the sum has no minimum
_SMALL = 1e-12  # m of slack that is rounding error
_ROUNDS, _AGREED, _NEARLY = 30, 1e-6, 1e-2  # rounds of friction limits; their change, of the largest, that ends them or will do
_SHRINKS, _LEAST_PART = 0.5, 0.05  # part of the last round's change to which the next one has to shrink; least part taken of one


@njit(cache=True)
def contact_forces(
    compliance: np.ndarray, free: np.ndarray, wound: np.ndarray, given: np.ndarray, tension: np.ndarray, gap: np.ndarray,
    yielding: np.ndarray, friction: np.ndarray, bend: np.ndarray, pressed: np.ndarray, rub: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:  # fmt: skip
    """Return the forces (k,) of all rows, their changes (k, m) by the tensions, states (c,), and whether all conditions hold.

    compliance S (k, k) and free (k,): of the response. wound (m,): displacement to which each cable is pulled in, NaN: released;
    given (m,): tensions, which take precedence, or (0,); tension (m,): first guess. gap (c,) in m; yielding (c,): m/N of walls;
    friction (c,): coefficients, (0,) where there are no rows of friction; bend (e,): D in N/m; pressed (c,) and rub (c, 2):
    normal forces and friction in N, first guesses. The changes by the tensions hold the places that touch in contact, and those
    that stick at rest. The conditions include that the robot stays there, if its stiffness without walls is positive.
    """
    m, c = len(wound), len(gap)
    rubbing = len(friction) > 0
    rows = m + (3 * c if rubbing else c)
    extra = len(bend)
    w, q, turned = compliance[:rows, :rows].copy(), free[:rows].copy(), np.zeros((extra, rows + 1))
    turning, balanced = bend, False
    if extra:  # eliminate the last rows
        own = np.ascontiguousarray(compliance[rows:, rows:])
        if bend.max() > 0.0 and not _stable(own, bend):
            bend, balanced = np.minimum(bend, 0.0), True
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
    for a in range(m):
        if len(given):
            low[a] = high[a] = given[a]
        elif np.isfinite(wound[a]):
            low[a], force[a] = 0.0, tension[a]
            q[a] -= wound[a]
        else:
            low[a] = high[a] = 0.0
    for i in range(c):
        low[m + i], force[m + i] = 0.0, pressed[i]
    settled = _rub(w, q, m, c, friction, rub, low, high, force) if rubbing else _bounded(w, q, low, high, force)
    state = np.empty(c, dtype=np.int64)
    for i in range(c):
        k = m + c + 2 * i
        if force[m + i] <= 0.0:
            state[i] = OPEN
        else:
            most = (1.0 - AT_LIMIT) * high[k] if rubbing else 0.0
            sticks = rubbing and abs(force[k]) < most and abs(force[k + 1]) < most
            state[i] = STICKING if sticks else SLIDING
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
    if settled and balanced:
        body = compliance.copy()
        for i in range(c):
            body[m + i, m + i] += yielding[i]
        settled = not leaves(np.int64(0), body, whole, friction, turning, wound, given, c)
    return whole, changes, state, settled


@njit(cache=True)
def _stable(compliance: np.ndarray, bend: np.ndarray) -> bool:
    """Whether the body at the middles, with the forces that turn with convex obstacles, still resists: S^-1 - D is positive."""
    c = len(bend)
    softer = np.empty((c, c))
    for i in range(c):
        for j in range(c):
            softer[i, j] = -np.sqrt(max(bend[i], 0.0) * max(bend[j], 0.0)) * compliance[i, j]
        softer[i, i] += 1.0
    return np.linalg.eigvalsh(softer)[0] > _STIFF


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
    force: np.ndarray,
) -> bool:  # fmt: skip
    """Find forces with friction; returns whether limits and normal forces agree. rub (c, 2): first guess of the friction."""
    limit, change, before, part, largest = friction * force[m : m + c], np.zeros(c), np.zeros(c), 1.0, np.inf
    for i in range(c):
        force[m + c + 2 * i : m + c + 2 * i + 2] = rub[i]
    for turn in range(_ROUNDS):
        for i in range(c):
            for k in range(m + c + 2 * i, m + c + 2 * i + 2):
                high[k], low[k] = limit[i], -limit[i]
        if not _bounded(w, q, low, high, force):
            return False
        wanted = friction * force[m : m + c]
        before[:], change[:], last = change, wanted - limit, largest
        largest = float(np.abs(change).max()) / max(float(wanted.max()), 1e-300)
        if largest <= _AGREED:
            break
        if turn and largest > _SHRINKS * last:  # they go to and fro: the limit lies between
            turned = before - change
            part = min(max(part * float(before @ turned) / max(float(turned @ turned), 1e-300), _LEAST_PART), 1.0)
        limit = np.maximum(limit + part * change, 0.0)
    return largest <= _NEARLY


@njit(cache=True)
def _bounded(w: np.ndarray, q: np.ndarray, low: np.ndarray, high: np.ndarray, force: np.ndarray) -> bool:
    """Minimise f^T w f / 2 + q^T f within bounds low, high (n,); force (n,): a guess, then the result. Returns whether found."""
    force[:] = np.minimum(np.maximum(force, low), high)
    start = force.copy()
    if _switched(w, q, low, high, force):
        return True
    force[:] = start
    return _lowered(w, q, low, high, force)


@njit(cache=True)
def _switched(w: np.ndarray, q: np.ndarray, low: np.ndarray, high: np.ndarray, force: np.ndarray) -> bool:
    """Look for the minimum by changing every force that is wrongly at a bound, or beyond one: all at once, or only the last."""
    n = len(q)
    index, side, wanted = np.empty(n, dtype=np.int64), np.zeros(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    for a in range(n):
        side[a] = -1 if force[a] <= low[a] else (1 if force[a] >= high[a] else 0)
    fewest, patience = n + 1, _PATIENCE
    for _ in range(_SWITCHES):
        count = 0
        for a in range(n):
            if side[a] == 0 and low[a] < high[a]:
                index[count] = a
                count += 1
                force[a] = 0.0
            else:
                force[a] = low[a] if side[a] < 0 or low[a] == high[a] else high[a]
        _solve_free(w, q, index[:count], force)
        slope = q + w @ force
        wrong, last, rounding = 0, -1, 1e-12 * np.abs(force).max()
        for a in range(n):
            wanted[a] = side[a]
            if low[a] == high[a]:
                continue
            if side[a] == 0:
                wanted[a] = -1 if force[a] < low[a] - rounding else (1 if force[a] > high[a] + rounding else 0)
            elif (side[a] < 0 and slope[a] < -_SMALL) or (side[a] > 0 and slope[a] > _SMALL):
                wanted[a] = 0
            if wanted[a] != side[a]:
                wrong, last = wrong + 1, a
        if wrong == 0:
            return True
        patience = _PATIENCE if wrong < fewest else patience - 1
        fewest = min(fewest, wrong)
        if patience > 0:
            side[:] = wanted
        else:
            side[last] = wanted[last]
    return False


@njit(cache=True)
def _solve_free(w: np.ndarray, q: np.ndarray, index: np.ndarray, force: np.ndarray) -> None:
    """Write the forces `index` for which their slopes vanish, those of the others given."""
    count = len(index)
    if not count:
        return
    known = q + w @ force
    block, right = np.empty((count, count)), np.empty(count)
    for a in range(count):
        right[a] = -known[index[a]]
        for b in range(count):
            block[a, b] = w[index[a], index[b]]
    solved = np.linalg.solve(block, right)
    for a in range(count):
        force[index[a]] += solved[a]


@njit(cache=True)
def _lowered(w: np.ndarray, q: np.ndarray, low: np.ndarray, high: np.ndarray, force: np.ndarray) -> bool:
    """Look for the minimum by steps that each lower the sum: slower, but they cannot go round in circles.

    A body that only walls keep from buckling has a response w that is not positive definite, and the sum may have no minimum: the
    search then ends with the forces before they ran away.
    """
    n = len(q)
    for a in range(n):
        if w[a, a] <= 0.0 and low[a] < high[a]:
            return False
    index = np.empty(n, dtype=np.int64)
    allowed = _SMALL + 1e-10 * np.abs(q).max()
    for _ in range(_STEPS):
        before, slope = force.copy(), q + w @ force
        for _ in range(_SWEEPS):
            for a in range(n):
                if low[a] < high[a]:
                    moved = min(max(force[a] - slope[a] / w[a, a], low[a]), high[a]) - force[a]
                    force[a] = min(max(force[a] + moved, low[a]), high[a])
                    if moved != 0.0:
                        for b in range(n):
                            slope[b] += moved * w[b, a]
        count = 0
        for a in range(n):
            if low[a] < force[a] < high[a]:
                index[count] = a
                count += 1
        aim, slope = force.copy(), q + w @ force
        _solve_free(w, q, index[:count], aim)
        share = 1.0
        for _ in range(_HALVES):
            clipped = np.minimum(np.maximum(force + share * (aim - force), low), high)
            change = clipped - force
            if slope @ change + 0.5 * (change @ (w @ change)) <= 0.0:
                force[:] = clipped
                break
            share *= 0.5
        way = force - before
        if way @ (w @ way) < 0.0 and np.abs(force).max() > _RUNAWAY * np.abs(before).max():
            force[:] = before
            return False
        slope, left = q + w @ force, 0.0
        for a in range(n):
            if low[a] < high[a]:
                inward = (force[a] <= low[a] and slope[a] > 0.0) or (force[a] >= high[a] and slope[a] < 0.0)
                left = max(left, 0.0 if inward else abs(slope[a]))
        if left <= allowed:
            return True
    return False
