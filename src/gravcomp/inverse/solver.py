"""Solving the programme of one step with ProxQP (Bambade et al., RSS 2022), in units in which no solve takes long (`scaling`).

After gravity has jumped the bounds on displacement may be out of reach of tensions within theirs. Then the programme is solved with
elastic bounds on displacement: a variable of its own for each cable takes up what cannot be kept, at a cost high enough that nothing
is left of it otherwise. So there always is a solution, and the command is held to its limits afterwards.
"""

import math
import time
from typing import NamedTuple

import numpy as np

from gravcomp.inverse.scaling import NO_BOUND, ScaledProgramme

_ELASTIC_COST = 1e4
_ACCURACY = 1e-7
# Bounds that can be kept together take about one iteration, ten where the set of active ones changes.
_MOST_ITERATIONS, _MOST_ELASTIC_ITERATIONS = 40, 300


class SolverFailed(RuntimeError):
    """The programme was not solved; the text says why."""


class Solution(NamedTuple):
    """What the solver found, in its units: the programme's unknowns, the multipliers of its rows and then of its box; solve_time s;
    iterations. `scaling.unscaled` makes tensions of it, before the next solve, which writes over it.
    """

    unknowns: np.ndarray
    multipliers: np.ndarray
    solve_time: float
    iterations: int


class ProgrammeSolver:
    """Solves one programme after another, each started from the last solution. The same sequence gives the same bits."""

    def __init__(self):
        from proxsuite import proxqp  # not with the module: its start is slow, and a description of a programme needs none

        self._proxqp = proxqp
        self.reset()

    def reset(self) -> None:
        """Forget the last solution: the next solve starts cold."""
        self._exact = self._elastic = None

    def solve(self, programme: ScaledProgramme) -> Solution:
        """The programme's solution. Raises SolverFailed; after that the next solve starts cold."""
        started = time.perf_counter()
        if not math.isfinite(programme.trace):
            raise SolverFailed("the model's linear answer holds numbers that are not finite")
        parts = programme[:7]
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
        return Solution(results.x, results.z, time.perf_counter() - started, results.info.iter)

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
        info = qp.results.info
        # The status alone says 'solved' of numbers that are not finite.
        return qp, info.status == self._proxqp.PROXQP_SOLVED and math.isfinite(info.objValue)


def _with_elastic_bounds(hessian, gradient, rows, lower, upper, box_lower, box_upper):
    """The programme's parts with a variable more for each row, which gives way to the row's bounds."""
    m, free = len(rows), np.full(len(rows), NO_BOUND)
    larger = np.zeros((2 * m, 2 * m))
    larger[:m, :m], larger[m:, m:] = hessian, _ELASTIC_COST * np.eye(m)
    return (
        larger, np.append(gradient, np.zeros(m)), np.hstack([rows, np.eye(m)]), lower, upper,
        np.append(box_lower, -free), np.append(box_upper, free),
    )  # fmt: skip
