"""Kalman filter of a load and of the errors that look like one.

The state is x = (load, s_E, s_w, b_e, b_lambda, b_u, b_f): the load in k numbers that give the force D x, the relative errors of
compliance and weight (`sensitivity`), and what is off in the tip (creep, hysteresis), in the tensions (zeros of the sensors), in
the cables' displacements (backlash, stretch), and in the tensions by friction. A force, b_e and b_u walk at random (Kalman
1960). As a load makes cables slack, each measurement is linearised again at the state that it leads to (iterated filter,
Jazwinski 1970).

A payload comes at once and then stays. What is measured of it loses its weight within a time t_p (fading memory, Sorenson and
Sacks 1971): dP/dt = 2 (P - P^2 / s^2) / t_p, up to the variance s^2 of a load that may be anything. A walk at random would need
its size; that of the largest load which the cables hold lets the estimate of a small payload follow each turn of friction.

Friction adds a share mu of the tension T to what a sensor reads, or takes it away, and turns round with the cable's motion,
however small. So b_f is a coloured noise of standard deviation mu T that is forgotten within a time t_f (Bryson and Johansen
1965): db_f = -b_f dt / t_f + mu T sqrt(2 / t_f) dw. If it were taken for white, it would be averaged away, and its turns would be
explained by what else changes with the tension, such as s_E.

The errors are learnt while the robot is known to carry nothing. Afterwards they only count in the variances (Schmidt 1966): a
load that comes must not be taken for an error, nor the robot's lag behind the model.
"""

import copy
from collections.abc import Callable

import numpy as np

from gravcomp.description import Limits
from gravcomp.load_estimation.options import LoadEstimationOptions
from gravcomp.load_estimation.sensitivity import HeldRobot, Sensitivity

_ITERATIONS = 6
_LATELY = 2.0  # times in which friction may turn round
_SAME = 1e-3  # of the standard deviation of the load: a change that ends the iteration


class LoadFilter:
    """State and covariance; m cables, k numbers of the load."""

    def __init__(self, options: LoadEstimationOptions, limits: Limits, cables: int, numbers: int, sag: float):
        """limits: of the cables; sag in m: by which the tip hangs without them."""
        self._options, self._k, self._m = options, numbers, cables
        size = numbers + 5 + 3 * cables
        self.state = np.zeros(size)
        self.learning = True  # of the errors
        tip, offset = options.drift * sag + options.tip_std, options.tension_offset * limits.tension_max
        self._displacement = options.displacement_error * limits.displacement_max
        deviations = [*[0.0] * numbers, options.stiffness_error, options.weight_error, *[tip] * 3, *[offset] * cables]
        deviations += [self._displacement] * cables + [0.0] * cables
        self.covariance = np.diag(np.square(deviations))
        self._sag, self._floor = sag, options.tension_floor * limits.tension_max
        self._largest = limits.tension_max
        self._left, self._weight = 0.0, 0.0  # sums of H^T S^-1 r and H^T S^-1 H

    @property
    def load(self) -> np.ndarray:
        """The load (k,)."""
        return self.state[: self._k]

    @property
    def load_covariance(self) -> np.ndarray:
        """Covariance (k, k) of the load."""
        return self.covariance[: self._k, : self._k]

    @property
    def unexplained(self) -> np.ndarray:
        """Variance (k, k) of a payload by what it leaves unexplained of the last measurements; zeros for a force, which walks."""
        left = self._left / self._weight if self._weight > 0.0 else 0.0
        return np.full((self._k, self._k), left**2)

    def set_load(self, load: np.ndarray, covariance: np.ndarray) -> None:
        """Let the load be `load` (k,) with this covariance (k, k); what is known of the errors stays."""
        self.state[: self._k] = load
        self.covariance[: self._k] = 0.0
        self.covariance[:, : self._k] = 0.0
        self.covariance[: self._k, : self._k] = covariance
        self._left = self._weight = 0.0

    def covariance_by_tip(self, robot: HeldRobot, carried: np.ndarray, off: np.ndarray, deviation: float) -> np.ndarray:
        """Return the covariance (3, 3) N^2 of the force `carried` (3,) N that a model needs at a measured tip.

        off (3,) m: of the model's tip from the measured one; deviation in N: of the force before. The errors that were learnt are
        not taken out of this force, and count as if they were not known.
        """
        alone = self.copy()
        alone.learning = False
        alone.covariance += np.outer(self.state, self.state)
        alone.state[:] = 0.0
        alone.set_load(carried, deviation**2 * np.eye(3))
        alone.take_tip(np.zeros(3), robot, np.eye(3), carried, off)
        return alone.load_covariance

    def open_load(self, deviation: float) -> None:
        """Let the load be anything of this standard deviation around what it was."""
        self.covariance[: self._k, : self._k] = deviation**2 * np.eye(self._k)
        self._left = self._weight = 0.0

    def copy(self) -> "LoadFilter":
        """Return a filter in the same state; the steps of one do not change the other."""
        other = copy.copy(self)
        other.state, other.covariance = self.state.copy(), self.covariance.copy()
        return other

    def diffuse(self, elapsed: float, deviation: float, tension: np.ndarray, change: np.ndarray) -> None:
        """Let what walks walk, for `elapsed` s.

        A load that is forgotten is anything of this standard deviation, so that what no sensor sees of it stays bounded; 0: it is
        known. tension (m,) N: of the cables; change (m,) N: of the model's since the last call.
        """
        k, m, options = self._k, self._m, self._options
        friction = slice(k + 5 + 2 * m, None)
        step, kept = np.zeros(len(self.state)), np.ones(len(self.state))
        if options.kind == "payload":
            self._fade(np.exp(-2.0 * elapsed / options.payload_time), deviation)
            kept_sums = float(np.exp(-elapsed / (_LATELY * options.friction_time)))
            self._left, self._weight = kept_sums * self._left, kept_sums * self._weight
        else:
            kept[:k] = np.exp(-elapsed / options.change_time)
        kept[friction] = np.exp(-elapsed / options.friction_time)
        self.state *= kept
        self.covariance *= np.outer(kept, kept)
        step[:k] = (1.0 - kept[:k] ** 2) * deviation**2
        step[k + 2 : k + 5] = (options.drift * self._sag) ** 2 * elapsed
        step[k + 5 + m : k + 5 + 2 * m] = self._displacement**2 * np.minimum(1.0, np.abs(change) / self._largest)
        step[friction] = (1.0 - kept[friction] ** 2) * (options.cable_friction * tension) ** 2
        self.covariance[np.diag_indices(len(step))] += step

    def _fade(self, kept: float, deviation: float) -> None:
        """Keep a share of the information P^-1 - 1 / deviation^2 on the load."""
        if deviation > 0.0:
            covariance = self.load_covariance
            faded = kept * np.eye(self._k) + (1.0 - kept) / deviation**2 * covariance
            self.covariance[: self._k, : self._k] = np.linalg.solve(faded, covariance)

    def take_tip(
        self, residual: np.ndarray, robot: HeldRobot, direction: np.ndarray, carried: np.ndarray, moved: np.ndarray
    ) -> float:
        """Take a measured tip and return the squared Mahalanobis distance from what was expected.

        residual (3,) m: against the model, which carries the force (3,) N; direction D (3, k); moved (3,) m: of the model while
        the robot may be behind it.
        """
        k, noise = self._k, self._options.tip_std**2 * np.eye(3) + np.outer(moved, moved)

        def seen(at: Sensitivity) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
            rows = np.zeros((3, len(self.state)))
            rows[:, :k] = at.tip_force @ direction
            rows[:, k] = rows[:, k + 1] = at.tip_error
            rows[:, k + 2 : k + 5] = np.eye(3)
            rows[:, k + 5 + self._m : k + 5 + 2 * self._m] = at.tip_cables
            return residual, at.tip, rows, noise

        return self._take(seen, robot, direction, carried)

    def take_tensions(
        self,
        residual: np.ndarray,
        robot: HeldRobot,
        direction: np.ndarray,
        carried: np.ndarray,
        moved: np.ndarray,
        tension: np.ndarray,
    ) -> float:
        """Take measured tensions (m,) N, as `take_tip`; cables that should be slack are left out."""
        k, m = self._k, self._m
        noise = np.diag((self._options.tension_noise * tension) ** 2 + self._floor**2) + np.outer(moved, moved)

        def seen(at: Sensitivity) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
            rows = np.zeros((m, len(self.state)))
            rows[:, :k] = at.tension_force @ direction
            rows[:, k], rows[:, k + 1] = at.tension_stiffness, at.tension_weight
            rows[:, k + 5 : k + 5 + m] = rows[:, k + 5 + 2 * m :] = np.eye(m)
            rows[:, k + 5 + m : k + 5 + 2 * m] = at.tension_cables
            return residual[at.taut], at.tension[at.taut], rows[at.taut], noise[np.ix_(at.taut, at.taut)]

        return self._take(seen, robot, direction, carried)

    def _take(
        self,
        seen: Callable[[Sensitivity], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]],
        robot: HeldRobot,
        direction: np.ndarray,
        carried: np.ndarray,
    ) -> float:
        """Take a measurement: residual, what the load changes of it, derivatives by the state, noise; all of the taut cables."""
        k, start = self._k, self.state
        state, distance = start, 0.0
        deviation = np.sqrt(np.diag(self.load_covariance))
        for iteration in range(_ITERATIONS):
            residual, changed, rows, noise = seen(robot.under(direction @ state[:k] - carried))
            if not len(residual):
                return 0.0
            errors = rows.copy()
            errors[:, :k] = 0.0
            innovation = residual - changed - errors @ state - rows @ (start - state)
            spread = rows @ self.covariance @ rows.T + noise
            if iteration == 0:
                distance = float(innovation @ np.linalg.solve(spread, innovation))
                if self._options.kind == "payload" and not self.learning:
                    weighted = np.linalg.solve(spread, rows[:, 0])
                    self._left += float(weighted @ innovation)
                    self._weight += float(weighted @ rows[:, 0])
            gain = np.linalg.solve(spread, rows @ self.covariance).T
            if not self.learning:
                gain[k:] = 0.0
            last, state = state, start + gain @ innovation
            if (np.abs(state[:k] - last[:k]) <= _SAME * deviation).all():
                break
        self.state = state
        kept = np.eye(len(state)) - gain @ rows
        self.covariance = kept @ self.covariance @ kept.T + gain @ noise @ gain.T
        return distance
