"""Solution of one step's programme with ProxQP (Bambade et al., RSS 2022), scaled for fast convergence (`scaling`).

After a jump of gravity, no tensions within their bounds may satisfy the bounds on displacement. Then the programme is solved
with elastic bounds: one more variable for each row takes up the violation, at a cost high enough that it vanishes wherever the
bounds can be satisfied. What is around the robot costs less than what its winches can do, because a command that they cannot
follow keeps it out of nothing. So there always is a solution, and the command is clamped to its limits afterwards.
"""

import math
import time
from typing import Any, NamedTuple

import numpy as np

from gravcomp.inverse.scaling import NO_BOUND, ScaledProgramme

_ELASTIC_COST, _AROUND_COST = 1e4, 1e2
_ACCURACY = 1e-7
# If the bounds are compatible, one iteration is typical, and ten when the active set changes.
_MOST_ITERATIONS, _MOST_ELASTIC_ITERATIONS = 40, 300


class SolverFailed(RuntimeError):
    """The programme was not solved; the text gives the reason."""


class Solution(NamedTuple):
    """A solution in the solver's units: unknowns, multipliers of the rows and then of the box; solve_time in s; iterations.

    The next solve overwrites its arrays: call `scaling.unscaled` before.
    """

    unknowns: np.ndarray
    multipliers: np.ndarray
    solve_time: float
    iterations: int


class ProgrammeSolver:
    """Solves a sequence of programmes, each started from the last solution.

    The same sequence gives the same solutions but for rounding: ProxQP adds in an order that depends on where its memory begins.
    """

    def __init__(self) -> None:
        from proxsuite import proxqp  # here, because its import is slow and not every user of the module solves

        self._proxqp = proxqp
        self.reset()

    def reset(self) -> None:
        """Forget the last solution: the next solve starts cold."""
        self._exact: Any = None
        self._elastic: Any = None
        self._rows = 0

    def solve(self, programme: ScaledProgramme) -> Solution:
        """Return the programme's solution. Raises SolverFailed; the next solve then starts cold."""
        started = time.perf_counter()
        if not math.isfinite(programme.trace):
            raise SolverFailed("the model's linear response contains numbers that are not finite")
        parts = programme[:7]
        if len(programme.rows) != self._rows:
            self.reset()
            self._rows = len(programme.rows)
        self._exact, found = self._solved(self._exact, _MOST_ITERATIONS, *parts)
        results = self._exact.results
        if found:
            self._elastic = None
        else:
            self._exact = None
            elastic = _with_elastic_bounds(*parts, first_around=programme.first_around)
            self._elastic, found = self._solved(self._elastic, _MOST_ELASTIC_ITERATIONS, *elastic)
            results = self._elastic.results
            if not found:
                self.reset()
                raise SolverFailed(f"the solver ended with {results.info.status.name}")
        return Solution(results.x, results.z, time.perf_counter() - started, results.info.iter)

    def _solved(
        self,
        qp: Any,
        most_iterations: int,
        hessian: np.ndarray,
        gradient: np.ndarray,
        rows: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
        box_lower: np.ndarray,
        box_upper: np.ndarray,
    ) -> tuple[Any, bool]:
        """Solve with `qp`, from its last solution, or with a new one if it is None; return the QP and whether it was solved."""
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
        # ProxQP reports 'solved' also for numbers that are not finite.
        return qp, info.status == self._proxqp.PROXQP_SOLVED and math.isfinite(info.objValue)


def _with_elastic_bounds(
    hessian: np.ndarray, gradient: np.ndarray, rows: np.ndarray, lower: np.ndarray, upper: np.ndarray, box_lower: np.ndarray,
    box_upper: np.ndarray, *, first_around: int,
) -> tuple[np.ndarray, ...]:  # fmt: skip
    """Return the programme's parts with one more variable for each row, which makes the row's bounds elastic."""
    count, m, free = len(rows), len(gradient), np.full(len(rows), NO_BOUND)
    larger = np.zeros((m + count, m + count))
    larger[:m, :m] = hessian
    larger[m:, m:] = np.diag(np.where(np.arange(count) < first_around, _ELASTIC_COST, _AROUND_COST))
    return (
        larger, np.append(gradient, np.zeros(count)), np.hstack([rows, np.eye(count)]), lower, upper,
        np.append(box_lower, -free), np.append(box_upper, free),
    )  # fmt: skip
