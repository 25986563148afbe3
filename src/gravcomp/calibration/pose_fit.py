"""Least-squares fit to measured poses, with intervals and cross-validation.

    min over x of  sum |marker(x) - measured|^2 / sigma^2 + sum_i x_i^2

x holds the logarithm of the modulus, which has no prior, and the other unknowns in units of the standard deviation of their
priors. Intervals hold at 95 % (`pose_intervals`); they contain what the clamp leaves open, and that of the modulus what the model
lacks, as in `fit`.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from gravcomp.calibration.fit import TipNoise
from gravcomp.calibration.measured import MeasurementError, rms_distance
from gravcomp.calibration.pose_intervals import covariance, mistaken, not_shown, systematic
from gravcomp.calibration.pose_prediction import PosePredictor
from gravcomp.calibration.poses import PoseParameters, Poses
from gravcomp.confidence import half_width
from gravcomp.config import parameter
from gravcomp.description import Robot

_DIFFERENCE = 1e-2  # step of difference quotients, in x
_FARTHEST = 5.0  # bound of unknowns with a prior


@dataclasses.dataclass(frozen=True)
class PosePriors:
    """What is assumed before the measurement: standard deviations without a unit, so that they suit a robot of any size."""

    noise_share: float = parameter(
        8e-3, minimum=1e-6, maximum=0.1, description="error of model and markers, over the robot's length"
    )
    base_share: float = parameter(0.014, minimum=1e-6, maximum=1.0, description="offset of the base, over the robot's length")
    base_turn: float = parameter(3.0, edge="deg", minimum=1e-4, maximum=90.0, description="rotation of the base about each axis")
    zero_share: float = parameter(3e-3, minimum=1e-6, maximum=1.0, description="zero of a cable, over the robot's length")
    radius: float = parameter(0.045, minimum=1e-6, maximum=1.0, description="distance of a cable's end from the axis, relative")
    angle: float = parameter(4.0, edge="deg", minimum=1e-4, maximum=90.0, description="angle of a cable about the axis")
    gain: float = parameter(0.1, minimum=1e-6, maximum=10.0, description="gain of a measured tension, relative")
    stiffness: float = parameter(
        TipNoise.stiffness, minimum=0.0, maximum=0.5, description="error of the stiffness that no fit sees, relative"
    )


@dataclasses.dataclass(frozen=True)
class PoseUnknown:
    """One entry of x: `field` of PoseParameters at `index` (None: all entries alike).

    scale: the prior's standard deviation in SI.
    """

    name: str
    unit: str
    field: str
    index: int | None
    scale: float
    factor: float = 1.0  # from SI to `unit`

    @property
    def free(self) -> bool:
        """Whether there is no prior."""
        return self.field == "youngs_modulus"

    def added(self, parameters: PoseParameters, x: float) -> PoseParameters:
        """Return the parameters changed by x."""
        if self.free:
            return dataclasses.replace(parameters, youngs_modulus=parameters.youngs_modulus * float(np.exp(x)))
        value = getattr(parameters, self.field).copy()
        value[slice(None) if self.index is None else self.index] += x * self.scale
        return dataclasses.replace(parameters, **{self.field: value})


MODULUS = PoseUnknown("Young's modulus", "kPa", "youngs_modulus", None, 1.0, 1e-3)


def base_unknowns(robot: Robot, priors: PosePriors) -> tuple[PoseUnknown, ...]:
    """Return the rigid offset of the base: its position along, and its rotation about, each axis."""
    return tuple(
        PoseUnknown(f"base {field[5:]} {axis}", unit, field, index, scale, factor)
        for field, unit, scale, factor in (
            ("base_position", "mm", priors.base_share * robot.length, 1e3),
            ("base_rotation", "deg", priors.base_turn, 180 / np.pi),
        )
        for index, axis in enumerate("xyz")
    )


def tension_gain(priors: PosePriors, cable: int | None = None, name: str = "tension gain") -> PoseUnknown:
    """Return the gain of one cable, or of all alike."""
    return PoseUnknown(name, "", "gain", cable, priors.gain)


@dataclasses.dataclass(frozen=True)
class PoseEstimate:
    """A fitted value with its half interval at 95 %, both in `unit`."""

    name: str
    unit: str
    initial: float
    value: float
    interval: float


@dataclasses.dataclass(frozen=True)
class PoseFit:
    """Result of a fit: x, parameters, estimates, the predicted markers (k, p, 3) in m, and the root mean square distance in m.

    open: sentences on what the poses do not show.
    """

    x: np.ndarray
    parameters: PoseParameters
    estimates: tuple[PoseEstimate, ...]
    predicted: np.ndarray
    rms_before: float
    rms: float
    evaluations: int
    open: tuple[str, ...] = ()


def fit_poses(
    robot: Robot,
    poses: Poses,
    unknowns: Sequence[PoseUnknown],
    *,
    priors: PosePriors | None = None,
    start: np.ndarray | None = None,
    progress: Callable[[str], None] = lambda sentence: None,
) -> PoseFit:
    """Fit the unknowns to the poses. Raises MeasurementError if the described robot has no equilibrium in a pose.

    start: where the fit begins, x of another fit; x = 0, the described robot, where it has no equilibrium. At other points
    without equilibrium residuals are NaN: least_squares takes a shorter step then.
    """
    from scipy.optimize import least_squares

    priors = priors or PosePriors()
    noise = priors.noise_share * robot.length
    predictor = PosePredictor(robot, poses)
    initial = predictor.initial()
    prior = np.array([not unknown.free for unknown in unknowns])
    count = 0

    def at(x: np.ndarray) -> PoseParameters:
        parameters = initial
        for unknown, entry in zip(unknowns, x):
            parameters = unknown.added(parameters, float(entry))
        return parameters

    def residuals(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        error = predictor.predict(at(x)) - poses.measured
        progress(f"evaluation {count}: {1e3 * rms_distance(error):.3f} mm RMS")
        return np.concatenate([error.ravel() / noise, x[prior]])

    def jacobian(x: np.ndarray) -> np.ndarray:
        here, columns = residuals(x), []
        for step in _DIFFERENCE * np.eye(len(x)):
            column = (residuals(x + step) - here) / _DIFFERENCE
            if not np.isfinite(column).all():  # beyond the end of a branch of equilibria
                column = (here - residuals(x - step)) / _DIFFERENCE
            columns.append(np.nan_to_num(column))
        return np.column_stack(columns)

    described = np.zeros(len(unknowns))
    x = described if start is None else np.asarray(start, dtype=float)
    before = residuals(x)
    if start is not None and not np.isfinite(before).all():
        x, before = described, residuals(described)
    if not np.isfinite(before).all():
        lost = np.flatnonzero(np.isnan(before[: poses.measured.size].reshape(poses.count, -1)).any(axis=1))
        raise MeasurementError(f"{poses.source}: the robot has no equilibrium in pose {poses.name[lost[0]]}")
    solution = least_squares(residuals, x, jac=jacobian, bounds=(-_FARTHEST, _FARTHEST), xtol=1e-3, ftol=1e-4, max_nfev=15)
    parameters = at(solution.x)
    predicted = predictor.predict(parameters)
    matrix = covariance(solution.jac[: poses.measured.size], (predicted - poses.measured) / noise, prior)
    variance = np.diag(matrix) + np.where(prior, 0.0, priors.stiffness**2)
    half = half_width(max(1, poses.measured.size - len(unknowns))) * np.sqrt(variance)
    progress("what the clamp leaves open")
    loose = (PosePredictor(_without_contraction(robot), poses).predict(parameters) - predicted).ravel() / noise
    half += systematic(solution.jac[: poses.measured.size], loose, prior)
    estimates = tuple(
        _estimate(unknown, initial, parameters, float(value), float(width))
        for unknown, value, width in zip(unknowns, solution.x, half)
    )
    rms_before = rms_distance(before[: poses.measured.size].reshape(poses.measured.shape) * noise)
    sentences = not_shown([unknown.name for unknown in unknowns], matrix, prior)
    if not prior.all() and _weight_alone(robot, poses):
        sentences.append(
            "Only the robot's own weight bends it against its stiffness here, so the poses show Young's modulus over density: a"
            " density that is 1 % off makes the modulus 1 % off. Weigh the robot, or hang weights of known mass from it."
        )
    sentences += mistaken(predicted - poses.measured, poses.name, poses.marker_name)
    rms = rms_distance(predicted - poses.measured)
    return PoseFit(solution.x, parameters, estimates, predicted, rms_before, rms, count, tuple(sentences))


def _without_contraction(robot: Robot) -> Robot:
    """Return the robot of materials that do not contract across; wound springs, whose geometry would change, stay."""
    springs = [segment.spring is not None for segment in robot.segments] or [False] * len(robot.materials)
    return robot.with_materials(
        [
            material if spring else dataclasses.replace(material, poissons_ratio=0.0)
            for material, spring in zip(robot.materials, springs)
        ]
    )


def _weight_alone(robot: Robot, poses: Poses) -> bool:
    """Return whether no known force acts on the robot: all forces are its own weight's, or follow from its stiffness."""
    hung = robot.payload.mass or any(load.mass for load in robot.loads) or any(load.mass for row in poses.loads for load in row)
    return not hung and (poses.tension is None or not poses.tension.any())


def held_out(
    robot: Robot,
    poses: Poses,
    unknowns: Sequence[PoseUnknown],
    folds: Sequence[np.ndarray],
    *,
    start: np.ndarray | None = None,
    progress: Callable[[str], None] = lambda sentence: None,
) -> np.ndarray:
    """Return the markers (k, p, 3) predicted for the poses of each fold by a fit to all the others."""
    predicted = np.full_like(poses.measured, np.nan)
    for number, fold in enumerate(folds):
        rest = np.setdiff1d(np.arange(poses.count), fold)

        def show(sentence: str, number: int = number) -> None:
            progress(f"fold {number + 1} of {len(folds)}, {sentence}")

        fit = fit_poses(robot, poses.rows(rest), unknowns, start=start, progress=show)
        predicted[fold] = PosePredictor(robot, poses.rows(fold)).predict(fit.parameters)
    return predicted


def _estimate(unknown: PoseUnknown, initial: PoseParameters, final: PoseParameters, x: float, half: float) -> PoseEstimate:
    if unknown.free:
        value = unknown.factor * final.youngs_modulus
        return PoseEstimate(unknown.name, unknown.unit, unknown.factor * initial.youngs_modulus, value, value * half)
    index = 0 if unknown.index is None else unknown.index
    before = float(getattr(initial, unknown.field)[index])
    return PoseEstimate(
        unknown.name,
        unknown.unit,
        unknown.factor * before,
        unknown.factor * (before + x * unknown.scale),
        unknown.factor * half * unknown.scale,
    )
