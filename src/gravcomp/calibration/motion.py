"""Fit of modulus, damping and creep to measured courses of the tip.

    min over x = (log E, log beta, log rho, log T) of  sum_k |tip(t_k; x) - measured_k|^2

with the lasting modulus E, the Kelvin-Voigt damping time beta, and rho and T of the creep branch (see `full_model.viscosity`).
Without that branch one modulus would have to be right both for the swing, in which a soft material is stiffer, and for the rest
after it.

Intervals are at 95 %, from the Jacobian at the solution. The residuals of neighbouring samples are correlated, so the variance
is multiplied by (1 + rho) / (1 - rho), where rho is the correlation from sample to sample.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.course import course_options, predict_course
from gravcomp.calibration.measured import Measured, rms_distance
from gravcomp.confidence import half_width
from gravcomp.description import Robot
from gravcomp.full_model.generalized_alpha import DynamicsOptions
from gravcomp.full_model.modes import first_period

_MODULUS_RANGE, _DAMPING_RANGE = (0.05, 20.0), (0.02, 50.0)  # times the values at the start
# Of rho, and of T in first periods: in these courses slower creep does not show, and faster creep acts like damping.
_CREEP_RANGES = ((0.002, 2.0), (0.1, 18.0))
_CREEP_START = 0.08, 1.4
# Length of the beginnings that are fitted first, in first periods. If the model swings out of phase, the fit ends in a wrong
# minimum with too much damping; such a short beginning contains no full swing.
_BEGINNING = 1.08
_DIFFERENCE = 0.02  # step of x for the derivatives
EVALUATIONS = 12
"""Most evaluations of each of the two fits: to the beginnings, and to the whole courses."""


@dataclass(frozen=True)
class MotionFit:
    """The fitted robot and its values in SI.

    *_interval: half width of the interval at 95 %, NaN if the value was not fitted; evaluations: number of predictions of all
    courses, shorter ones counted by their length; rms_before and rms_after: tip error in m, the first None where the motion of
    the robot as it is described cannot be computed; predicted: tips (t, 3) of each course; damping_seen: False if the courses
    contain too little motion to determine the damping.
    """

    robot: Robot
    youngs_modulus: float
    modulus_interval: float
    damping_time: float
    damping_interval: float
    creep_ratio: float
    creep_ratio_interval: float
    creep_time: float
    creep_time_interval: float
    evaluations: int
    rms_before: float | None
    rms_after: float
    predicted: list[np.ndarray]
    damping_seen: bool


def fit_motion(
    robot: Robot,
    courses: list[Measured],
    *,
    mapper: Callable[[Callable, list], list] = lambda function, jobs: list(map(function, jobs)),
    progress: Callable[[str], None] = lambda sentence: None,
    modulus: bool = True,
    creep: bool = True,
    evaluations: int = EVALUATIONS,
) -> MotionFit:
    """Fit to the courses. mapper: as `map`, may compute courses in parallel; modulus, creep: False keeps the robot's values.

    evaluations: at most, of each of the two fits; with a few the values do not converge.

    A fitted modulus is that of all segments. Values with which a motion cannot be computed are a refused step of the fit; raises
    RuntimeError where it cannot be computed with those of the robot.
    """
    from scipy.optimize import least_squares

    material = robot.materials[0]
    starts = {"damping_time": material.damping_time}
    ranges = {"damping_time": material.damping_time * np.array(_DAMPING_RANGE)}
    if modulus:
        starts["youngs_modulus"] = material.youngs_modulus
        ranges["youngs_modulus"] = material.youngs_modulus * np.array(_MODULUS_RANGE)
    beginning, period = _Parameters(robot, starts, ranges), first_period(robot)
    if creep:
        scale = (1.0, period)
        starts = starts | dict(zip(("creep_ratio", "creep_time"), np.multiply(_CREEP_START, scale)))
        ranges = ranges | dict(zip(("creep_ratio", "creep_time"), np.array(_CREEP_RANGES) * np.array(scale)[:, None]))
    all_of_them = _Parameters(robot, starts, ranges)
    first = _BEGINNING * period
    beginnings = [course.rows(course.time <= course.time[0] + first) for course in courses]
    steps = course_options(robot)  # the same for all values, so that they do not change the derivatives
    short = _Courses(beginnings, beginning.robot_at, steps, mapper, progress)
    whole = _Courses(courses, all_of_them.robot_at, steps, mapper, progress)
    options = {"x_scale": "jac", "xtol": 2e-3, "ftol": 1e-3, "max_nfev": evaluations}
    x = least_squares(short.residuals, short.first(beginning.start), jac=short.jacobian, bounds=beginning.bounds, **options).x
    # In the beginning, the stiffness of the creep branch adds to the lasting one.
    x = np.concatenate([x, all_of_them.start[len(x) :]])
    if creep and modulus:
        x[1] -= np.log1p(_CREEP_START[0])
    x = whole.first(x, all_of_them.start)
    solution = least_squares(whole.residuals, x, jac=whole.jacobian, bounds=all_of_them.bounds, **options)
    x = solution.x
    simulated = [sum(len(course.time) for course in part.courses) * part.count for part in (short, whole)]
    error = solution.fun.reshape(-1, 3)
    freedom = max(1, error.size - len(x))
    rho = float(np.clip((error[1:] * error[:-1]).sum() / max((error**2).sum(), 1e-30), 0.0, 0.99))
    variance = float((error**2).sum()) / freedom * (1 + rho) / (1 - rho)
    deviation = np.sqrt(np.diag(np.linalg.pinv(solution.jac.T @ solution.jac) * variance)) * half_width(freedom)
    fitted = all_of_them.robot_at(x)
    final = fitted.materials[0]
    half = {name: getattr(final, name) * float(width) for name, width in zip(all_of_them.names, deviation)}
    before = np.concatenate(mapper(_tip_course, [(robot, course, steps) for course in courses])) - whole.measured
    return MotionFit(
        robot=fitted,
        youngs_modulus=final.youngs_modulus,
        modulus_interval=half.get("youngs_modulus", np.nan),
        damping_time=final.damping_time,
        damping_interval=half["damping_time"],
        creep_ratio=final.creep_ratio,
        creep_ratio_interval=half.get("creep_ratio", np.nan),
        creep_time=final.creep_time,
        creep_time_interval=half.get("creep_time", np.nan),
        evaluations=int(np.ceil(sum(simulated) / sum(len(course.time) for course in courses))),
        rms_before=rms_distance(before) if np.isfinite(before).all() else None,
        rms_after=rms_distance(whole.error(x)),
        predicted=whole.tips(x),
        damping_seen=bool(deviation[0] < 0.5),
    )


class _Parameters:
    """Logarithms x of fields of the robot's material, in the order of `names`."""

    def __init__(self, robot: Robot, starts: dict[str, float], ranges: dict[str, np.ndarray]):
        self._robot, self.names = robot, list(starts)
        self.start = np.log(list(starts.values()))
        self.bounds = tuple(np.log([ranges[name] for name in starts]).T)

    def robot_at(self, x: np.ndarray) -> Robot:
        """Return the robot with the values at x."""
        return self._robot.with_material(**{name: float(value) for name, value in zip(self.names, np.exp(x))})


class _Courses:
    """Residuals of the courses as functions of x, with a cache of predictions. count: number of predictions.

    They are NaN where a course cannot be computed: least_squares takes a shorter step then.
    """

    def __init__(self, courses: list[Measured], robot_at: Callable, steps: DynamicsOptions, mapper: Callable, progress: Callable):
        self.courses, self.count, self._steps = courses, 0, steps
        self._robot_at, self._mapper, self._progress = robot_at, mapper, progress
        self.measured = np.concatenate([course.tip_position for course in courses])
        self._tips: dict[tuple, list[np.ndarray]] = {}

    def first(self, *points: np.ndarray) -> np.ndarray:
        """Return the first of the points at which all courses can be computed. Raises RuntimeError."""
        for x in points:
            if np.isfinite(self.residuals(x)).all():
                return x
        source = self.courses[0].source
        raise RuntimeError(f"{source}: the motion of the robot as it is described cannot be computed over these courses")

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Return the tip errors in mm, as one vector."""
        # The solver needs the derivatives at x next: computed together, all predictions run in parallel.
        self._predict([x, *(x + step for step in _DIFFERENCE * np.eye(len(x)))])
        error = self.error(x)
        self._progress(f"evaluation {self.count}: {1e3 * rms_distance(error):.3f} mm RMS")
        return 1e3 * error.ravel()

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the derivative of the residuals by x, by forward differences.

        Where a course cannot be computed they are backward, and 0 where it cannot on that side either.
        """
        here, columns = self.error(x), []
        for step in _DIFFERENCE * np.eye(len(x)):
            moved = self.error(x + step) - here
            if not np.isfinite(moved).all():
                moved = here - self.error(x - step)
            columns.append(np.nan_to_num(1e3 * moved.ravel() / _DIFFERENCE))
        return np.column_stack(columns)

    def error(self, x: np.ndarray) -> np.ndarray:
        """Return modelled minus measured tips (t, 3) in m."""
        return np.concatenate(self.tips(x)) - self.measured

    def tips(self, x: np.ndarray) -> list[np.ndarray]:
        """Return the predicted tips (t, 3) of each course in m."""
        self._predict([x])
        return self._tips[tuple(x)]

    def _predict(self, points: list[np.ndarray]) -> None:
        """Predict the courses at those points that are not in the cache."""
        new = [x for x in points if tuple(x) not in self._tips]
        if not new:
            return
        tips = self._mapper(_tip_course, [(self._robot_at(x), course, self._steps) for x in new for course in self.courses])
        for index, x in enumerate(new):
            self._tips[tuple(x)] = tips[index * len(self.courses) : (index + 1) * len(self.courses)]
        self.count += len(new)


def _tip_course(job: tuple[Robot, Measured, DynamicsOptions]) -> np.ndarray:
    """Return the predicted tips (t, 3) of a course, NaN if it cannot be computed. Other processes import this function."""
    try:
        return predict_course(*job)[0]
    except RuntimeError:
        return np.full_like(job[1].tip_position, np.nan)
