"""Modulus, plate and release of the bare silicone beam, from its place at rest and its swing.

The beam's weight alone hardly shows the mass of the plate with the markers, see `PLATE` and `prediction_interval`.
"""

import dataclasses

import numpy as np

from gravcomp.calibration.pose_fit import PoseEstimate
from gravcomp.description import Elements
from gravcomp.experiments.measured.beam_model import FacePose, beam, resting_face
from gravcomp.experiments.measured.beam_recording import Recording, Swing, hand_turn, turn_in_plane
from gravcomp.full_model.modes import natural_frequencies
from gravcomp.full_model.robot_model import RobotModel

THEIRS = 263.8e3  # Pa, fitted by the authors
COARSE = Elements(around=8, along=6, radial=1, grading=3.0)
# kg: the plate with the markers on the free face weighs about so much. Nobody wrote how much, and the bare beam hardly shows it
# (a heavier plate on a stiffer beam sags and swings alike), so the prediction is also made without a plate.
PLATE, NO_PLATE = 2e-3, 1e-6
_FACE = 2e-3  # m: the markers' middle lies at that of the face in x and z, within this standard deviation
_MARKER = 0.1e-3  # m: error of a marker
_HAND = 0.5e-3  # m: error of the place where the hand held the face
_TURN = 0.05  # relative difference of the turn for a height between the swing and the shape at rest
_SWING, _CREEP = 0.02, 0.3  # relative errors of the modulus in the swing, and of the slowing to the rest


def hand_removed(recording: Recording, free: Swing) -> np.ndarray:
    """Return the held markers (3, 3) of a face that the hand does not turn in the plane, about their mean."""
    from scipy.spatial.transform import Rotation

    mean = recording.held.mean(axis=0)
    back = Rotation.from_rotvec([0.0, -hand_turn(recording, free), 0.0]).as_matrix()
    return mean + (recording.held - mean) @ back.T


def swing_modulus(free: Swing, plate: float) -> float:
    """Return Young's modulus in Pa with which the bare beam swings as measured, with a plate in kg."""
    return THEIRS * (free.frequency / frequency(THEIRS, 0.0, plate)) ** 2


def slowing(free: Swing, rest_time: float) -> float:
    """Return the logarithm of the modulus in the swing over that at rest, `rest_time` s after the release.

    In every e-fold of the time the compliance grows by the part (2 / pi) eta, for the loss factor eta (local form of the
    relations of Kramers and Kronig: J. D. Ferry, Viscoelastic Properties of Polymers, 1980, chapter 4). In the swing, eta
    follows from the decay; at rest this part is the creep that is measured. Between both it is taken as linear in the logarithm
    of the time.
    """
    mean = 0.5 * (2.0 / np.pi * free.loss + max(free.creep, 0.0))
    return float(mean * np.log(2 * np.pi * free.frequency * rest_time))


def frequency(modulus: float, mass: float, plate: float) -> float:
    """Return the lowest natural frequency in Hz of the beam of a modulus in Pa, a weight and a plate in kg."""
    return float(natural_frequencies(RobotModel(beam(modulus, mass, plate, COARSE)), 1)[0])


@dataclasses.dataclass(frozen=True)
class BareFit:
    """Fit to the bare beam: moduli at rest and in the swing in Pa, plate in kg, the face's middle (3,) from the markers' in m.

    covariance (2, 2) of the logarithm of their modulus over that at rest, and of the plate in kg.
    """

    slow: float
    fast: float
    plate: float
    shift: np.ndarray
    estimates: list[PoseEstimate]
    covariance: np.ndarray


def fit_bare(recording: Recording, free: Swing, elements: Elements, prior: float = PLATE) -> BareFit:
    """Fit to the place at rest and to the swing of the bare beam, each with its error. prior: plate in kg, known to as much."""
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    softness = np.array([0.85, 1.0, 1.2])  # their modulus over the beam's
    plates = (0.0, 2.0 * prior)
    vectors = np.array([[_vector(resting_face(THEIRS / s, 0.0, plate, elements)) for s in softness] for plate in plates])
    curves = [np.polyfit(np.log(softness), along, 2) for along in vectors]
    swinging = np.array([swing_modulus(free, plate) for plate in plates])
    crept = slowing(free, recording.rest_time)
    held = hand_removed(recording, free)
    middle = held.mean(axis=0)
    turn = _TURN * turn_in_plane(recording.held, recording.rest)

    def parts(x: np.ndarray) -> tuple[float, FacePose, np.ndarray]:
        """Modulus of the swing, pose of the face, and its middle."""
        heavy = 0.5 + 0.5 * x[6]
        vector = np.array([x[0] ** 2, x[0], 1.0]) @ ((1.0 - heavy) * curves[0] + heavy * curves[1])
        pose = FacePose(vector[:3], Rotation.from_rotvec(vector[3:]).as_matrix())
        fast = float((1.0 - heavy) * swinging[0] + heavy * swinging[1])
        return fast, pose, middle + _FACE * np.array([x[1], 0.0, x[2]])

    def residuals(x: np.ndarray) -> np.ndarray:
        fast, pose, centre = parts(x)
        hand = _HAND * np.array([x[3], 0.0, x[4]])
        angle = turn * x[5] - free.turn * hand[0]  # the hand's turn follows from the travel, and so from its height
        turned = np.cross([0.0, angle, 0.0], recording.rest - recording.rest.mean(axis=0))
        error = pose.carry(held, centre) - hand + turned - recording.rest
        slow = np.log(THEIRS / fast) + crept - x[0]
        return np.concatenate([error[:, [0, 2]].ravel() / _MARKER, [slow / np.hypot(_SWING, _CREEP * crept)], x[1:]])

    found = least_squares(residuals, np.zeros(7))
    covariance = np.linalg.inv(found.jac.T @ found.jac)
    half = 1.96 * np.sqrt(np.diag(covariance))
    slow, (fast, _, centre) = THEIRS * float(np.exp(-found.x[0])), parts(found.x)
    plate = prior * (1.0 + float(found.x[6]))
    estimates = [
        PoseEstimate("Young's modulus at rest", "kPa", 1e-3 * THEIRS, 1e-3 * slow, 1e-3 * slow * half[0]),
        PoseEstimate("Young's modulus in the swing", "kPa", 1e-3 * THEIRS, 1e-3 * fast, np.nan),
        PoseEstimate("plate with the markers", "g", 1e3 * prior, 1e3 * plate, 1e3 * prior * half[6]),
        PoseEstimate("hand too high", "mm", 0.0, 1e3 * _HAND * found.x[3], 1e3 * _HAND * half[3]),
    ]
    for index, axis in ((1, "x"), (2, "z")):
        name = f"middle of the face to that of the markers, {axis}"
        estimates.append(PoseEstimate(name, "mm", 0.0, 1e3 * _FACE * found.x[index], 1e3 * _FACE * half[index]))
    scale = np.diag([1.0, prior])
    return BareFit(slow, fast, max(plate, 0.0), centre - middle, estimates, scale @ covariance[np.ix_([0, 6], [0, 6])] @ scale)


def prediction_interval(fit: BareFit, mass: float, elements: Elements) -> float:
    """Return the half width in m, at 95 %, of the predicted sag under a weight in kg: what the bare beam leaves open."""
    softer, heavier = 0.01, 5e-4  # of the logarithm, kg
    here, *there = (
        resting_face(modulus, mass, plate, elements).position[0]
        for modulus, plate in (
            (fit.slow, fit.plate),
            (fit.slow * np.exp(-softer), fit.plate),
            (fit.slow, fit.plate + heavier),
        )
    )
    slope = np.array([(there[0] - here) / softer, (there[1] - here) / heavier])
    return 1.96 * float(np.sqrt(slope @ fit.covariance @ slope))


def _vector(pose: FacePose) -> np.ndarray:
    """Place and rotation vector (6,) of a pose."""
    from scipy.spatial.transform import Rotation

    return np.concatenate([pose.position, Rotation.from_matrix(pose.rotation).as_rotvec()])
