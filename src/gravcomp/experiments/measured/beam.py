"""A clamped silicone beam that is released, bare or under a hung weight. The bare one gives modulus and damping.

Each recording starts with the beam held straight by hand: the markers' places before the release are their places at rest.
They are fixed rigidly to the free face. The beam bends in the vertical plane. Where the hand held it a little aside, the
markers come to rest aside: this shift and the two turns out of the plane are registered for each recording, the motion in the
plane is not.
"""

import csv
import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.calibration.measured import MeasurementError
from gravcomp.calibration.pose_fit import PoseEstimate
from gravcomp.calibration.pose_report import error_bars, fitted_table
from gravcomp.description import Elements, Material, PointLoad, Robot, Section, Segment
from gravcomp.experiments.measured.part import Part
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.dynamics import DynamicSolver
from gravcomp.full_model.generalized_alpha import DynamicsOptions
from gravcomp.full_model.modes import natural_frequencies
from gravcomp.full_model.observation import observe
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.statics import StaticSolver
from gravcomp.report.drawing import MODEL, REAL, Drawing
from gravcomp.report.result import Figure, Plot, Table

LENGTH, WIDTH = 0.1, 0.03
THEIRS = 263.8e3  # Pa, fitted by the authors
GRAVITY = np.array([-9.81, 0.0, 0.0])  # the recordings' x points upwards
EDGE = (WIDTH / 2, 0.0, LENGTH)  # the weights hang from the middle of the upper edge of the free face
_KINDS = {"gravity": 0.0, "load52": 52e-3, "load101": 101e-3}
_FINE = Elements(around=8, along=14, radial=2, grading=6.0)
_COARSE = Elements(around=8, along=6, radial=1, grading=3.0)
_STEP = 5e-3  # s
_SHOWN = 3.0  # s of the motion
_CREEP_TIME = 0.5  # s
_FACE = 2e-3  # m: the markers' middle lies at that of the face in x and z, within this standard deviation
_HELD = 0.4e-3  # m: error of the places where the hand held the markers


@dataclasses.dataclass(frozen=True)
class Recording:
    """One recording. mass of the weight in kg; time (t,) in s from the release; markers (t, 3, 3) in m, `held` (3, 3): before."""

    name: str
    mass: float
    time: np.ndarray
    markers: np.ndarray
    held: np.ndarray

    @property
    def rest(self) -> np.ndarray:
        """Mean places (3, 3) of the markers in the last second."""
        return self.markers[self.time > self.time[-1] - 1.0].mean(axis=0)


@dataclasses.dataclass(frozen=True)
class FacePose:
    """Place (3,) of the free face's middle, and its rotation (3, 3)."""

    position: np.ndarray
    rotation: np.ndarray

    def carry(self, at: np.ndarray, middle: np.ndarray) -> np.ndarray:
        """Return where points `at` (p, 3) go that are fixed to the face, whose middle was at `middle` (3,)."""
        return middle + (self.position - [0.0, 0.0, LENGTH]) + (at - middle) @ self.rotation.T


def read(path: Path) -> Recording:
    """Read a recording. Raises MeasurementError."""
    mass = next((mass for kind, mass in _KINDS.items() if path.stem.startswith(kind)), None)
    if mass is None:
        raise MeasurementError(f"{path}: the name begins with none of {', '.join(_KINDS)}")
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        time = np.array([float(row["time_s"]) for row in rows])
        markers = 1e-3 * np.array([[[float(row[f"tip{i}_{axis}_mm"]) for axis in "xyz"] for i in (1, 2, 3)] for row in rows])
    except (OSError, KeyError, ValueError) as error:
        raise MeasurementError(f"{path}: cannot be read: {error}") from error
    height = markers[:, :, 0].mean(axis=1)
    fallen = np.flatnonzero(height < height[:10].mean() - 2e-3)
    if not len(fallen):
        raise MeasurementError(f"{path}: the markers never fall by 2 mm")
    release = time[fallen[0]] - np.sqrt(2 * 2e-3 / 9.81)
    held = markers[time < release - 0.1].mean(axis=0)
    return Recording(path.stem, mass, time - release, markers, held)


def beam(modulus: float, mass: float, elements: Elements, damping_time: float = 0.02, creep_ratio: float = 0.0) -> Robot:
    """Return the beam with a weight of `mass` in kg."""
    material = Material(
        "neo_hookean", modulus, 0.499, density=1070.0, damping_time=damping_time, creep_ratio=creep_ratio, creep_time=_CREEP_TIME
    )
    segment = Segment("beam", LENGTH, section=Section("rectangle", WIDTH, WIDTH), material=material)
    loads = (PointLoad(EDGE, mass),) if mass else ()
    return Robot("beam", segments=(segment,), elements=elements, loads=loads)


def face(model: RobotModel, u: np.ndarray) -> FacePose:
    """Return the pose of the free face at the displacements u (n, 3)."""
    from scipy.spatial.transform import Rotation

    sections = model.effectors.sections(model.mesh.nodes + u)
    _, _, orientation = observe(sections, np.zeros((*sections.shape, 0)))
    return FacePose(sections[-1, 0], Rotation.from_quat(orientation[-1]).as_matrix())


def resting_face(modulus: float, mass: float, elements: Elements) -> FacePose:
    """Return the free face's pose at rest. Raises RuntimeError if there is no equilibrium."""
    model = RobotModel(beam(modulus, mass, elements))
    state = StaticSolver(model).solve(GRAVITY, CableInput())
    if not state.converged:
        raise RuntimeError(f"beam: no equilibrium at {modulus * 1e-3:.0f} kPa under {1e3 * mass:.0f} g")
    return face(model, state.u)


def fit_modulus(recording: Recording, elements: Elements) -> tuple[float, np.ndarray, list[PoseEstimate]]:
    """Return the modulus in Pa, the face's middle (3,) from that of the markers in m, and the estimates."""
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    softness = np.array([0.85, 1.0, 1.2])  # their modulus over the beam's
    poses = [resting_face(THEIRS / s, recording.mass, elements) for s in softness]
    vectors = np.array([np.concatenate([p.position, Rotation.from_matrix(p.rotation).as_rotvec()]) for p in poses])
    curve = np.polyfit(np.log(softness), vectors, 2)
    middle = recording.held.mean(axis=0)

    def at(x: np.ndarray) -> tuple[FacePose, np.ndarray]:
        vector = np.array([x[0] ** 2, x[0], 1.0]) @ curve
        return FacePose(vector[:3], Rotation.from_rotvec(vector[3:]).as_matrix()), middle + _FACE * np.array([x[1], 0.0, x[2]])

    def residuals(x: np.ndarray) -> np.ndarray:
        pose, centre = at(x)
        error = pose.carry(recording.held, centre) - recording.rest
        return np.concatenate([error[:, [0, 2]].ravel() / _HELD, x[1:]])

    found = least_squares(residuals, np.zeros(3))
    half = 1.96 * np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    modulus = THEIRS * float(np.exp(-found.x[0]))
    estimates = [PoseEstimate("Young's modulus", "kPa", 1e-3 * THEIRS, 1e-3 * modulus, 1e-3 * modulus * half[0])]
    for index, axis in ((1, "x"), (2, "z")):
        estimates.append(
            PoseEstimate(
                f"middle of the face to that of the markers, {axis}",
                "mm",
                0.0,
                1e3 * _FACE * found.x[index],
                1e3 * _FACE * half[index],
            )
        )
    return modulus, at(found.x)[1] - middle, estimates


def registered(predicted: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Return the predicted markers (3, 3), shifted along y and turned about x and z onto the measured ones by least squares."""
    arms = predicted - predicted.mean(axis=0)
    columns = [np.tile([0.0, 1.0, 0.0], (3, 1)), np.cross([1.0, 0.0, 0.0], arms), np.cross([0.0, 0.0, 1.0], arms)]
    design = np.array([column.ravel() for column in columns]).T
    x, *_ = np.linalg.lstsq(design, (measured - predicted).ravel(), rcond=None)
    return predicted + (design @ x).reshape(3, 3)


def swing(recording: Recording) -> tuple[float, float]:
    """Return the frequency in Hz and the decay rate in 1/s of the free swing, fitted to the markers' mean height."""
    from scipy.optimize import least_squares

    within = (recording.time > 0.1) & (recording.time < 1.5)
    time, height = recording.time[within], 1e3 * (recording.markers - recording.rest).mean(axis=1)[within, 0]
    frequencies = np.linspace(2.0, 15.0, 521)
    power = [abs(height @ np.exp(-2j * np.pi * f * time)) for f in frequencies]
    start = [1.0, 1.0, 0.0, 2 * np.pi * frequencies[int(np.argmax(power))], 2.0]

    def residuals(x: np.ndarray) -> np.ndarray:
        envelope = np.exp(-x[4] * time)
        return envelope * (x[0] * np.cos(x[3] * time) + x[1] * np.sin(x[3] * time)) + x[2] - height

    found = least_squares(residuals, start)
    return abs(float(found.x[3])) / (2 * np.pi), float(found.x[4])


def fit_damping(recording: Recording, modulus: float, elements: Elements) -> tuple[float, float, float, float]:
    """Return damping time in s, creep ratio, and the measured frequency in Hz and decay rate in 1/s.

    A swing of the frequency f and the decay rate g in a material of the stiffness E (1 + rho) has the damping time
    2 (g - rho / (1 + rho) / (2 T)) (1 + rho) / (2 pi f)^2, with the creep time T.
    """
    frequency, decay = swing(recording)
    own = float(natural_frequencies(RobotModel(beam(modulus, recording.mass, elements)), 1)[0])
    ratio = max((frequency / own) ** 2 - 1.0, 0.0)
    slow = 0.5 * ratio / (1.0 + ratio) / _CREEP_TIME
    return max(2 * (decay - slow) * (1 + ratio) / (2 * np.pi * frequency) ** 2, 0.0), ratio, frequency, decay


def motion(robot: Robot, duration: float) -> list[FacePose]:
    """Return the free face at every 2 steps after the release. Raises RuntimeError if a step does not converge."""
    model = RobotModel(robot)
    solver = DynamicSolver(model, DynamicsOptions(time_step=_STEP))
    solver.place(np.zeros_like(model.mesh.nodes), gravity=GRAVITY)
    poses = [face(model, solver.state.u)]
    for number in range(round(duration / _STEP)):
        if not _advance(solver, _STEP):
            raise RuntimeError(f"beam: the motion does not converge at {number * _STEP:.3f} s")
        if number % 2:
            poses.append(face(model, solver.state.u))
    return poses


def _advance(solver: DynamicSolver, step: float, halvings: int = 5) -> bool:
    """Move on by `step` s, in halves if that does not converge. Returns whether it was possible."""
    if solver.step(GRAVITY, CableInput(), step).converged:
        return True
    return halvings > 0 and _advance(solver, step / 2, halvings - 1) and _advance(solver, step / 2, halvings - 1)


def motion_error(recording: Recording, predicted: np.ndarray) -> tuple[float, float]:
    """Return the root mean square distance in m of markers (t, 3, 3) predicted every 10 ms, and the shift of the release in s.

    The hand's release is not recorded exactly: it is shifted by up to 30 ms to the smallest error.
    """
    step, best = 2 * _STEP, (np.inf, 0.0)
    flat = predicted.reshape(len(predicted), -1)
    clock = step * np.arange(len(predicted))
    for shift in np.arange(-0.03, 0.0301, 0.002):
        within = (recording.time >= shift) & (recording.time <= shift + clock[-1])
        model = np.array([np.interp(recording.time[within] - shift, clock, column) for column in flat.T]).T.reshape(-1, 3, 3)
        error = recording.markers[within] - model
        best = min(best, (float(np.sqrt((error**2).sum(axis=2).mean())), float(shift)))
    return best


def evaluate(folder: Path, progress: Callable[[str], None], brief: bool) -> Part:
    """Fit to the first bare recording, and predict the loaded ones (brief: at rest only, on a coarse mesh)."""
    recordings = [read(path) for path in sorted(folder.glob("*.csv"))]
    bare = [r for r in recordings if r.mass == 0.0]
    if not bare:
        raise MeasurementError(f"{folder}: contains no recording gravity_*.csv, to which the modulus is fitted")
    mesh = _COARSE if brief else _FINE
    progress("modulus")
    modulus, shift, estimates = fit_modulus(bare[0], mesh)
    rest = {mass: resting_face(modulus, mass, mesh) for mass in sorted({r.mass for r in recordings})}
    rows, error, vertical = [], {}, {}
    corrections = {}
    for recording in recordings:
        plain = rest[recording.mass].carry(recording.held, recording.held.mean(axis=0) + shift)
        fitted = registered(plain, recording.rest)
        corrections[recording.name] = fitted - plain
        error[recording.name] = 1e3 * np.linalg.norm(fitted - recording.rest, axis=1)
        unregistered = 1e3 * np.linalg.norm(plain - recording.rest, axis=1)
        vertical[recording.name] = 1e3 * float((plain - recording.rest)[:, 0].mean())
        travel = 1e3 * (recording.rest - recording.held).mean(axis=0)
        rows.append(
            (
                recording.name, f"{travel[0]:.2f}, {travel[1]:.2f}, {travel[2]:.2f}", vertical[recording.name],
                float(error[recording.name].max()), float(unregistered.max()),
            )
        )  # fmt: skip
    loaded = [r for r in recordings if r.mass > 0.0]
    worst = float(max((error[r.name].max() for r in loaded), default=np.nan))
    part = Part(
        figures=[
            Figure("beam: markers at rest under load, worst", worst, "mm", "2.0 mm, the mean marker with their modulus", 0.8)
        ],
        parts=[
            Table(
                "Beam: at rest",
                (
                    "recording",
                    "mean travel measured, mm",
                    "vertical error, mean, mm",
                    "marker error, worst, mm",
                    "the same, not registered, mm",
                ),
                rows,
                "Registered out of the plane of bending: one shift and two turns for each recording.",
            ),
            error_bars("Beam: error of each marker at rest", ["1", "2", "3"], error, "Registered out of the plane of bending."),
        ],
        notes=[
            f"beam: before the release a hand holds the bare beam straight to about {1e3 * _HELD:g} mm of its travel of 6.5 mm."
            f" This gives the modulus to ± {100 * estimates[0].interval / estimates[0].value:.0f} %, and the travel under the"
            " weights to the same part. Where the hand held the face nearer to the clamp or turned in the plane of bending, this"
            " remains in the error of the markers at rest."
        ],
        data={"beam_rest_mm": worst, "beam_vertical_mm": vertical, "beam_modulus_kpa": 1e-3 * modulus},
    )
    if not brief:
        _add_motion(part, recordings, bare[0], modulus, shift, corrections, estimates, progress)
    part.parts.insert(
        0, fitted_table("Beam: fitted to the bare beam", estimates, f"The authors' modulus: {1e-3 * THEIRS:g} kPa.")
    )
    return part


def _add_motion(
    part: Part,
    recordings: list[Recording],
    bare: Recording,
    modulus: float,
    shift: np.ndarray,
    corrections: dict[str, np.ndarray],
    estimates: list[PoseEstimate],
    progress: Callable[[str], None],
) -> None:
    """Add figures, plot and data of the motion to the part."""
    progress("damping")
    damping, ratio, frequency, decay = fit_damping(bare, modulus, _COARSE)
    estimates.append(PoseEstimate("damping time", "ms", 20.0, 1e3 * damping, np.nan))
    estimates.append(PoseEstimate("creep ratio", "", 0.0, ratio, np.nan))
    errors, curves = {}, []
    for recording in recordings:
        progress(f"motion of {recording.name}")
        poses = motion(beam(modulus, recording.mass, _COARSE, damping, ratio), _SHOWN)
        middle = recording.held.mean(axis=0) + shift
        predicted = np.array([pose.carry(recording.held, middle) for pose in poses]) + corrections[recording.name]
        error, release = motion_error(recording, predicted)
        errors[recording.name] = 1e3 * error
        curves.append((recording, predicted, release))
    worst = max(errors.values())
    part.figures.append(Figure("beam: markers in the first 3 s after the release, RMS, worst recording", worst, "mm", "", 2.5))
    with Drawing(1, len(curves), width=4.2 * len(curves), height=3.0, squeeze=False) as drawing:
        for axes, (recording, predicted, release) in zip(drawing.axes[0], curves):
            within = (recording.time > -0.2) & (recording.time < _SHOWN)
            axes.plot(
                recording.time[within] - release,
                1e3 * (recording.markers - recording.held).mean(axis=1)[within, 0],
                color=REAL,
                label="measured",
            )
            clock = 2 * _STEP * np.arange(len(predicted))
            axes.plot(clock, 1e3 * (predicted - recording.held).mean(axis=1)[:, 0], color=MODEL, linewidth=1.0, label="predicted")
            axes.set_title(recording.name)
            axes.set_xlabel("time in s")
        drawing.axes[0, 0].set_ylabel("height in mm")
        drawing.axes[0, 0].legend()
    caption = f"Mean of the markers. The bare beam swings at {frequency:.2f} Hz and decays at {decay:.2f} 1/s."
    part.parts.append(Plot("Beam: motion", drawing.svg, caption))
    part.data |= {"beam_motion_mm": worst, "beam_motion_by_recording_mm": errors}
