"""Predicted motion of the tip over whole courses, and the fit of modulus, damping and creep to them.

    min over x = (log E, log beta, log rho, log T) of  sum_k |tip(t_k; x) - measured_k|^2

with the lasting modulus E, Kelvin's and Voigt's damping time beta, and rho and T of the branch that creeps (see `simulation.viscosity`). Without
that branch one modulus would have to be right both for the swing, in which a soft material is stiffer, and for the rest after it.

Intervals are at 95 %, from the Jacobian at the solution. Residuals of neighbouring samples are alike, so their number counts only as much as their
correlation rho from sample to sample leaves: the variance is multiplied by (1 + rho) / (1 - rho).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.measured import Measured
from gravcomp.description import Robot
from gravcomp.simulation import DynamicSimulator, DynamicsOptions, Shape, ShapeStatus

STRAIGHT = 2e-3  # m: a course whose tip begins nearer than that to the straight robot's begins straight
COURSE_OPTIONS = DynamicsOptions(time_step=5e-3)
"""Of predicted courses: steps of 5 ms follow a fall within a tenth of a millimetre."""
_MODULUS_RANGE, _DAMPING_RANGE = (0.05, 20.0), (0.02, 50.0)  # times the values at the start
_CREEP_RANGES = (
    (0.002, 2.0),
    (0.03, 5.0),
)  # of rho, and of T in s: slower creep is at rest for these courses, faster one is damping
_CREEP_START = 0.08, 0.4
# s: a model that swings out of phase is best overdamped, a wrong minimum; so short a beginning holds no swing to be out of phase with.
_FIRST_LOOK = 0.3
_DIFFERENCE = 0.02  # step of x for the derivatives


@dataclass(frozen=True)
class MotionFit:
    """The fitted robot, and its values in SI with the half widths of their intervals; evaluations: of all courses, shorter ones counted
    by their length.

    A value that was not fitted has the interval NaN. rms_before, rms_after: of the tip's distance, m; damping_seen: False where the courses
    hold too little motion to tell the damping.
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
    rms_before: float
    rms_after: float
    predicted: list[np.ndarray]
    damping_seen: bool


def predict_course(robot: Robot, course: Measured, options: DynamicsOptions = COURSE_OPTIONS) -> tuple[np.ndarray, np.ndarray]:
    """Tip positions (t, 3) in m and directions (t, 3) at the course's times. Raises RuntimeError where the motion cannot be followed."""
    straight = np.array([0.0, 0.0, robot.length]), np.array([0.0, 0.0, 1.0])
    rows = [
        straight if shape is None else (shape.tip_position, shape.tip_direction)
        for shape in predict_shapes(robot, course, options)
    ]
    tips, directions = zip(*rows)
    return np.array(tips), np.array(directions)


def predict_shapes(robot: Robot, course: Measured, options: DynamicsOptions = COURSE_OPTIONS) -> Iterator[Shape | None]:
    """The shapes at the course's times, None for a beginning at the straight robot. Raises RuntimeError as `predict_course`."""
    simulator = DynamicSimulator(robot, options)
    if np.linalg.norm(course.tip_position[0] - [0.0, 0.0, robot.length]) > STRAIGHT:
        yield simulator.settle(course.gravity[0], course.displacement[0])
    else:
        simulator.let_go(course.gravity[0])
        yield None
    for gravity, displacement, duration in zip(course.gravity[1:], course.displacement[1:], np.diff(course.time)):
        shape = simulator.step(gravity, displacement, duration=duration)
        if shape.status == ShapeStatus.NOT_CONVERGED:
            raise RuntimeError(f"the motion cannot be followed: {shape.message}")
        yield shape


def fit_motion(
    robot: Robot,
    courses: list[Measured],
    *,
    mapper: Callable[[Callable, list], list] = lambda function, jobs: [function(job) for job in jobs],
    progress: Callable[[str], None] = lambda sentence: None,
    modulus: bool = True,
    creep: bool = True,
) -> MotionFit:
    """Fit to the courses; `mapper` computes them side by side. modulus, creep: False leaves these as the robot has them."""
    from scipy.optimize import least_squares
    from scipy.stats import t as student

    material = robot.segments[0].material
    starts = {"damping_time": material.damping_time}
    ranges = {"damping_time": material.damping_time * np.array(_DAMPING_RANGE)}
    if modulus:
        starts["youngs_modulus"] = material.youngs_modulus
        ranges["youngs_modulus"] = material.youngs_modulus * np.array(_MODULUS_RANGE)
    first = _Parameters(robot, starts, ranges)
    if creep:
        starts = starts | dict(zip(("creep_ratio", "creep_time"), _CREEP_START))
        ranges = ranges | dict(zip(("creep_ratio", "creep_time"), _CREEP_RANGES))
    all_of_them = _Parameters(robot, starts, ranges)
    beginnings = [course.rows(course.time <= course.time[0] + _FIRST_LOOK) for course in courses]
    look, whole = (
        _Courses(beginnings, first.robot_at, mapper, progress),
        _Courses(courses, all_of_them.robot_at, mapper, progress),
    )
    options = {"x_scale": "jac", "xtol": 2e-3, "ftol": 1e-3, "max_nfev": 12}
    x = least_squares(look.residuals, first.start, jac=look.jacobian, bounds=first.bounds, **options).x
    # What creeps later is part of the stiffness of the beginning.
    x = np.concatenate([x, all_of_them.start[len(x) :]])
    if creep and modulus:
        x[1] -= np.log1p(_CREEP_START[0])
    solution = least_squares(whole.residuals, x, jac=whole.jacobian, bounds=all_of_them.bounds, **options)
    x = solution.x
    simulated = [sum(len(course.time) for course in look.courses) * look.count for look in (look, whole)]
    error = solution.fun.reshape(-1, 3)
    freedom = max(1, error.size - len(x))
    rho = float(np.clip((error[1:] * error[:-1]).sum() / max((error**2).sum(), 1e-30), 0.0, 0.99))
    variance = float((error**2).sum()) / freedom * (1 + rho) / (1 - rho)
    deviation = np.sqrt(np.diag(np.linalg.pinv(solution.jac.T @ solution.jac) * variance)) * student.ppf(0.975, freedom)
    fitted = all_of_them.robot_at(x)
    final = fitted.segments[0].material
    half = {name: getattr(final, name) * float(width) for name, width in zip(all_of_them.names, deviation)}
    before = np.concatenate(mapper(_tip_course, [(robot, course) for course in courses])) - whole.measured
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
        rms_before=_rms(before),
        rms_after=_rms(whole.error(x)),
        predicted=whole.tips(x),
        damping_seen=bool(deviation[0] < 0.5),
    )


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt((error**2).sum(axis=1).mean()))


class _Parameters:
    """Fields of the robot's material as logarithms x, in the order of `names`."""

    def __init__(self, robot: Robot, starts: dict[str, float], ranges: dict[str, np.ndarray]):
        self._robot, self.names = robot, list(starts)
        self.start = np.log(list(starts.values()))
        self.bounds = tuple(np.log([ranges[name] for name in starts]).T)

    def robot_at(self, x: np.ndarray) -> Robot:
        """The robot with these values."""
        return self._robot.with_material(**{name: float(value) for name, value in zip(self.names, np.exp(x))})


class _Courses:
    """Courses and their predictions at the points x that were asked for; lengths in mm for the solver."""

    def __init__(self, courses: list[Measured], robot_at: Callable, mapper: Callable, progress: Callable):
        self.courses, self.count = courses, 0
        self._robot_at, self._mapper, self._progress = robot_at, mapper, progress
        self.measured = np.concatenate([course.tip_position for course in courses])
        self._tips: dict[tuple, list[np.ndarray]] = {}

    def residuals(self, x: np.ndarray) -> np.ndarray:
        # The point's own derivatives will be asked for next; computed together they go side by side.
        self._predict([x, *(x + step for step in _DIFFERENCE * np.eye(len(x)))])
        error = self.error(x)
        self._progress(f"evaluation {self.count}: {1e3 * np.sqrt((error**2).sum(axis=1).mean()):.3f} mm RMS")
        return 1e3 * error.ravel()

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        here = self.error(x)
        return np.column_stack([1e3 * (self.error(x + s) - here).ravel() / _DIFFERENCE for s in _DIFFERENCE * np.eye(len(x))])

    def error(self, x: np.ndarray) -> np.ndarray:
        """(t, 3) m: modelled minus measured tips."""
        return np.concatenate(self.tips(x)) - self.measured

    def tips(self, x: np.ndarray) -> list[np.ndarray]:
        """(t, 3) a course."""
        self._predict([x])
        return self._tips[tuple(x)]

    def _predict(self, points: list[np.ndarray]) -> None:
        new = [x for x in points if tuple(x) not in self._tips]
        tips = self._mapper(_tip_course, [(self._robot_at(x), course) for x in new for course in self.courses]) if new else []
        for index, x in enumerate(new):
            self._tips[tuple(x)] = tips[index * len(self.courses) : (index + 1) * len(self.courses)]
        self.count += len(new)


def _tip_course(job: tuple[Robot, Measured]) -> np.ndarray:
    return predict_course(*job)[0]
