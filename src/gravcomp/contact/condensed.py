"""Contact forces, friction and cable tensions from the compliance of the body at the cables and at the places of contact.

With the linear response v = S f + v_free of the rows

    0 ... m - 1      cables: displacement, tension
    m ... m + c - 1  normal directions of the places
    2 c rows         tangents `around` and `along` of each place (only with friction)
    c rows           tangents `around` at the middle of the section, for the curvature of the obstacles

the forces satisfy

    cable:    lambda >= 0,   s = v - wound >= 0,                 lambda s = 0
    normal:   lambda >= 0,   s = gap + v + c lambda >= 0,        lambda s = 0      (c: compliance of a wall that yields)
    friction: |t| <= mu lambda;  v_t = 0 if less, else t = -mu lambda v_t / |v_t|

with v_t counted from the last equilibrium. Where an obstacle is curved, the direction of a normal force turns with the place: it
adds the force D v, D = lambda x curvature, to the rows of the middle, which is eliminated first.

The conditions are solved as a set of states (slack or taut, open, sticking or sliding) by linear solves, in each of which every
wrong state is changed at once (J. Judice, F. Pires, 1994; for friction the states of P. Alart, A. Curnier, 1991). When that
does not reduce the number of wrong states any more, one at a time is changed (K. G. Murty, 1974), and a place may only change
from sticking to sliding. The number of linear solves is bounded.
"""

import numpy as np
from numba import njit

OPEN, STICKING, SLIDING = 0, 1, 2
_SOFT = 1e-7  # of the mean compliance of the normals: shares the force among places that the model cannot move on their own
_PATIENCE, _MOST = 6, 80  # solves without fewer wrong states; solves in all
_SMALL = 1e-12  # m of slack that is rounding error
_STRAIGHT = 1e-9  # m by which a place may slide across the direction of its friction
_ROUNDED = 1e-9  # of a friction limit


@njit(cache=True)
def contact_forces(
    compliance: np.ndarray, free: np.ndarray, wound: np.ndarray, given: np.ndarray, taut: np.ndarray, gap: np.ndarray,
    yielding: np.ndarray, friction: np.ndarray, curvature: np.ndarray, pressed: np.ndarray, state: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, bool]:  # fmt: skip
    """Return the forces (k,) of all rows, their changes (k, m) by the tensions, and whether all conditions hold.

    compliance S (k, k) and free (k,): of the response. wound (m,): displacement to which each cable is pulled in, NaN: released;
    given (m,): tensions, which take precedence, or (0,); taut (m,): first guess. gap (c,) in m; yielding (c,): m/N of the walls;
    friction (c,): coefficients, (0,) where there are no rows of friction; curvature (c,) in 1/m; pressed (c,): normal forces of
    the last solution; state (c,): first guess, overwritten with the result. The changes by the tensions hold the places that
    touch in contact, and those that stick at rest.
    """
    m, c = len(wound), len(gap)
    rubbing = len(friction) > 0
    rows = m + (3 * c if rubbing else c)
    # Eliminate the rows of the curvature.
    bend = pressed * curvature
    inner = np.eye(c) - compliance[rows:, rows:] * bend
    if bend.max() > 0.0 and not _stable(compliance[rows:, rows:], bend):
        bend = np.minimum(bend, 0.0)
        inner = np.eye(c) - compliance[rows:, rows:] * bend
    both = np.empty((c, rows + 1))
    both[:, :rows] = compliance[rows:, :rows]
    both[:, rows] = free[rows:]
    turned = np.linalg.solve(inner, both)
    for i in range(c):
        turned[i] *= bend[i]
    part, middle = np.ascontiguousarray(turned[:, :rows]), np.ascontiguousarray(compliance[:rows, rows:])
    w = compliance[:rows, :rows] + middle @ part
    q = free[:rows] + middle @ np.ascontiguousarray(turned[:, rows])
    soft = 0.0
    for i in range(c):
        soft += _SOFT * compliance[m + i, m + i] / c
    for i in range(m, rows):
        w[i, i] += soft
    for i in range(c):
        w[m + i, m + i] += yielding[i]
        q[m + i] += gap[i]
    force = np.zeros(rows)
    tight = np.zeros(m, dtype=np.bool_)
    if len(given):
        force[:m] = given
        q = q + np.ascontiguousarray(w[:, :m]) @ given
    else:
        for a in range(m):
            q[a] -= wound[a] if np.isfinite(wound[a]) else 0.0
            tight[a] = taut[a] and np.isfinite(wound[a])
    settled = _states(w, q, wound, len(given) > 0, m, c, friction, tight, state, force)
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
    whole, changes = np.empty(rows + c), np.empty((rows + c, m))
    whole[:rows] = force
    changes[:rows] = change
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
def _states(
    w: np.ndarray, q: np.ndarray, wound: np.ndarray, given: bool, m: int, c: int, friction: np.ndarray, taut: np.ndarray,
    state: np.ndarray, force: np.ndarray,
) -> bool:  # fmt: skip
    """Find the states and write the forces; returns whether all conditions hold."""
    rubbing = len(friction) > 0
    rows = len(q)
    direction = np.zeros((c, 2))
    for i in range(c):
        if state[i] != OPEN and not (rubbing and friction[i] > 0.0):
            state[i] = SLIDING
        elif state[i] == SLIDING:
            _slide(q[m + c + 2 * i], q[m + c + 2 * i + 1], direction[i])
    fewest, waited, single = rows + 1, 0, False
    for attempt in range(_MOST):
        _solve(w, q, given, m, c, friction, taut, state, direction, force)
        response = q + w @ (np.concatenate((np.zeros(m), force[m:])) if given else force)
        wrong, turning = 0, False
        if not given:
            for a in range(m):
                bad = force[a] < 0.0 if taut[a] else np.isfinite(wound[a]) and response[a] < -_SMALL
                if bad and not (single and wrong):
                    taut[a] = not taut[a]
                wrong += bad
        for i in range(c):
            press = force[m + i]
            if state[i] == OPEN:
                if response[m + i] < -_SMALL:
                    if not (single and wrong):
                        state[i] = STICKING if rubbing and friction[i] > 0.0 else SLIDING
                    wrong += 1
                continue
            if press < 0.0:
                if not (single and wrong):
                    state[i] = OPEN
                wrong += 1
                continue
            if not rubbing or friction[i] == 0.0:
                continue
            k = m + c + 2 * i
            limit = friction[i] * press
            if state[i] == STICKING:
                pull = np.hypot(force[k], force[k + 1])
                if pull > limit * (1.0 + _ROUNDED) + 1e-15:
                    if not (single and wrong):
                        state[i] = SLIDING
                        direction[i, 0], direction[i, 1] = force[k] / pull, force[k + 1] / pull
                    wrong += 1
            else:
                along = direction[i, 0] * response[k] + direction[i, 1] * response[k + 1]
                speed = np.hypot(response[k], response[k + 1])
                if along > _SMALL and not single:
                    state[i] = STICKING
                    wrong += 1
                elif speed > _SMALL:
                    before_0, before_1 = direction[i, 0], direction[i, 1]
                    _slide(response[k], response[k + 1], direction[i])
                    turn_0, turn_1 = direction[i, 0] - before_0, direction[i, 1] - before_1
                    turning |= np.hypot(turn_0, turn_1) * speed > _STRAIGHT
                    if attempt > _PATIENCE:  # half of the turn, which damps directions that chase one another
                        _slide(turn_0 / 2.0 - direction[i, 0], turn_1 / 2.0 - direction[i, 1], direction[i])
        if not wrong and not turning:
            return True
        if wrong < fewest:
            fewest, waited = wrong, 0
        elif wrong:
            waited += 1
            single |= waited > _PATIENCE
    return False


@njit(cache=True)
def _slide(along_0: float, along_1: float, direction: np.ndarray) -> None:
    """Write the direction (2,) of friction against a motion."""
    speed = np.hypot(along_0, along_1)
    if speed > 0.0:
        direction[0], direction[1] = -along_0 / speed, -along_1 / speed


@njit(cache=True)
def _solve(
    w: np.ndarray, q: np.ndarray, given: bool, m: int, c: int, friction: np.ndarray, taut: np.ndarray, state: np.ndarray,
    direction: np.ndarray, force: np.ndarray,
) -> None:  # fmt: skip
    """Write the forces for the given states: those that act have no slack, sliding ones are in proportion to their normal."""
    rubbing = len(friction) > 0
    index = np.empty(len(q), dtype=np.int64)
    count = 0
    if not given:
        force[:m] = 0.0
        for a in range(m):
            if taut[a]:
                index[count] = a
                count += 1
    force[m:] = 0.0
    for i in range(c):
        if state[i] != OPEN:
            index[count] = m + i
            count += 1
            if rubbing and state[i] == STICKING:
                index[count], index[count + 1] = m + c + 2 * i, m + c + 2 * i + 1
                count += 2
    if not count:
        return
    block, right = np.empty((count, count)), np.empty(count)
    for a in range(count):
        row = index[a]
        right[a] = -q[row]
        for b in range(count):
            column = index[b]
            block[a, b] = w[row, column]
            place = column - m
            if rubbing and 0 <= place < c and state[place] == SLIDING:
                k = m + c + 2 * place
                limit = friction[place]
                block[a, b] += limit * (w[row, k] * direction[place, 0] + w[row, k + 1] * direction[place, 1])
    solved = np.linalg.solve(block, right)
    for a in range(count):
        force[index[a]] = solved[a]
    if rubbing:
        for i in range(c):
            if state[i] == SLIDING:
                k = m + c + 2 * i
                force[k] = friction[i] * force[m + i] * direction[i, 0]
                force[k + 1] = friction[i] * force[m + i] * direction[i, 1]
