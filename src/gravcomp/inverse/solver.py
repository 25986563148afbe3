"""Solving the programme of one step with ProxQP (Bambade et al., RSS 2022), scaled so that no solve takes long.

Tensions are scaled to a Hessian of unit diagonal and displacements to rows of unit length. After gravity has jumped the
bounds on displacement may be out of reach of tensions within theirs. Then the programme is solved with elastic bounds on
displacement: a variable of its own for each cable takes up what cannot be kept, at a cost high enough that nothing is left
of it otherwise. So there always is a solution, and the command is held to its limits afterwards.
"""

import math
import time
from dataclasses import dataclass

import numpy as np
from numba import njit

from gravcomp.inverse.programme import Programme

# Bounds that stand for 'none'; ProxQP takes 1e20 as infinite.
_NO_BOUND = 1e20
_ELASTIC_COST = 1e4
_ACCURACY = 1e-7
# Bounds that can be kept together take about one iteration, ten where the set of active ones changes.
_MOST_ITERATIONS, _MOST_ELASTIC_ITERATIONS = 40, 300
# N. ProxQP's last bits depend on where its memory lies; to this they are rounded away, so that a run can be repeated.
_QUANTUM = 2.0**-30


class SolverFailed(RuntimeError):
    """The programme was not solved; the text says why."""


@dataclass(frozen=True)
class Solution:
    """tension (m,) N; unwanted (m,) N: how far below its lower bound the programme would like a tension, 0 where the
    bound is not active; solve_time s; iterations."""

    tension: np.ndarray
    unwanted: np.ndarray
    solve_time: float
    iterations: int


class ProgrammeSolver:
    """Solves a sequence of programmes of one size, each started from the last solution. The same sequence gives the same bits."""

    def __init__(self, cables: int):
        from proxsuite import proxqp  # not with the module: its start is slow, and a description of a programme needs none

        self._proxqp = proxqp
        m = self._cables = cables
        self._hessian, self._gradient, self._rows = np.zeros((m, m)), np.zeros(m), np.zeros((m, m))
        self._lower, self._upper, self._box_lower, self._box_upper = (np.zeros(m) for _ in range(4))
        self.reset()

    def reset(self) -> None:
        """Forget the last solution: the next solve starts cold."""
        self._exact = self._elastic = None

    def solve(self, programme: Programme) -> Solution:
        """The programme's solution. Raises SolverFailed; after that the next solve starts cold."""
        started = time.perf_counter()
        m, bounds = self._cables, programme.bounds
        parts = self._hessian, self._gradient, self._rows, self._lower, self._upper, self._box_lower, self._box_upper
        tension_scale, trace = _scaled(programme, *parts)
        if not math.isfinite(trace):
            raise SolverFailed("the model's linear answer holds numbers that are not finite")
        self._exact, found = self._solved(self._exact, _MOST_ITERATIONS, *parts)
        results = self._exact.results
        if found:
            self._elastic = None
        else:
            self._exact = None
            self._elastic, found = self._solved(self._elastic, _MOST_ELASTIC_ITERATIONS, *_with_elastic_bounds(*parts))
            results = self._elastic.results
            if not found:
                self.reset()
                raise SolverFailed(f"the solver ended with {results.info.status.name}")
        tension, unwanted = _unscaled(m, results.x, results.z, tension_scale, bounds.tension_lower, bounds.tension_upper)
        return Solution(tension, unwanted, time.perf_counter() - started, int(results.info.iter))

    def _solved(self, qp, most_iterations: int, hessian, gradient, rows, lower, upper, box_lower, box_upper):
        """The QP, made where it is None and else started from its last solution, and whether it has a solution."""
        if qp is None:
            qp = self._proxqp.dense.QP(len(gradient), 0, len(rows), True)
            qp.settings.eps_abs = _ACCURACY
            qp.settings.max_iter = most_iterations
            qp.settings.initial_guess = self._proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
            qp.init(hessian, gradient, None, None, rows, lower, upper, box_lower, box_upper)
        else:
            qp.update(H=hessian, g=gradient, C=rows, l=lower, u=upper, l_box=box_lower, u_box=box_upper)
        qp.solve()
        results = qp.results
        x = results.x
        return qp, results.info.status == self._proxqp.PROXQP_SOLVED and math.isfinite(x @ x)


def _with_elastic_bounds(hessian, gradient, rows, lower, upper, box_lower, box_upper):
    """The programme's parts with a variable more for each row, which gives way to the row's bounds."""
    m, free = len(rows), np.full(len(rows), _NO_BOUND)
    larger = np.zeros((2 * m, 2 * m))
    larger[:m, :m], larger[m:, m:] = hessian, _ELASTIC_COST * np.eye(m)
    return (
        larger, np.append(gradient, np.zeros(m)), np.hstack([rows, np.eye(m)]), lower, upper,
        np.append(box_lower, -free), np.append(box_upper, free),
    )  # fmt: skip


@njit(cache=True)
def _scaled(programme, to_hessian, to_gradient, to_constraint, lower, upper, box_lower, box_upper):
    """Write the scaled programme's parts that are the tensions'; returns the tensions' scale (m,), and a sum in which a number that
    is not finite leaves its trace."""
    hessian, gradient, compliance, offset, bounds = programme
    m = len(gradient)
    # Millimetres make the cost of order one.
    scale = 1e-3 / np.sqrt(0.5 * np.diag(hessian))
    for i in range(m):
        to_gradient[i] = 0.5e6 * gradient[i] * scale[i]
        box_lower[i], box_upper[i] = bounds.tension_lower[i] / scale[i], min(bounds.tension_upper[i] / scale[i], _NO_BOUND)
        length = 0.0
        for k in range(m):
            to_hessian[i, k] = 0.5e6 * hessian[i, k] * scale[i] * scale[k]
            to_constraint[i, k] = compliance[i, k] * scale[k]
            length += to_constraint[i, k] ** 2
        row = 1.0 / np.sqrt(length)
        for k in range(m):
            to_constraint[i, k] *= row
        lower[i] = max((bounds.displacement_lower[i] - offset[i]) * row, -_NO_BOUND)
        upper[i] = min((bounds.displacement_upper[i] - offset[i]) * row, _NO_BOUND)
    return scale, hessian.sum() + gradient.sum() + offset.sum() + compliance.sum()


@njit(cache=True)
def _unscaled(m, x, z, scale, lower, upper):
    """Tensions within their bounds and how far below the lower one each is wanted, both (m,) N and free of the solver's last bits."""
    tension, unwanted = np.empty(m), np.empty(m)
    for i in range(m):
        tension[i] = min(max(np.rint(x[i] * scale[i] / _QUANTUM) * _QUANTUM, lower[i]), upper[i])
        # The Hessian's diagonal is one, so a multiplier is also the step that would undo it.
        unwanted[i] = np.rint(max(0.0, -z[m + i]) * scale[i] / _QUANTUM) * _QUANTUM
    return tension, unwanted
