"""A clamped silicone beam that is released, bare or under a hung weight. The bare one gives modulus and damping.

Each recording starts with the beam held straight by hand: the markers' places before the release are their places at rest.
They are fixed rigidly to the free face. The beam bends in the vertical plane. Where the hand held it a little aside, the
markers come to rest aside: this shift and the two turns out of the plane are registered for each recording. The hand's turn
in the plane follows from the free swing (`beam_recording.hand_turn`), without a model. The hand's height is not registered: it
is a part of the error at rest.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.calibration.measured import MeasurementError, rms_distance
from gravcomp.calibration.pose_fit import PoseEstimate
from gravcomp.calibration.pose_report import error_bars, fitted_table
from gravcomp.description import Elements, PronyTerm
from gravcomp.experiments.measured.beam_fit import (
    COARSE,
    NO_PLATE,
    PLATE,
    THEIRS,
    BareFit,
    fit_bare,
    frequency,
    hand_removed,
    prediction_interval,
)  # fmt: skip
from gravcomp.experiments.measured.beam_model import STEP, beam, motion, resting_face
from gravcomp.experiments.measured.beam_recording import Recording, Swing, hand_turn, read, swing
from gravcomp.experiments.measured.part import Part
from gravcomp.report.drawing import MODEL, REAL, Drawing
from gravcomp.report.result import Figure, Plot, Table

_FINE = Elements(around=8, along=14, radial=2, grading=6.0)
_SHOWN = 3.0  # s of the motion
_TIMES = (0.03, 0.1, 0.3, 1.0)  # s: relaxation times of the motion's material


def registered(predicted: np.ndarray, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the predicted markers (3, 3), shifted along y and turned about x and z onto the measured ones by least squares.

    Also returns the shift in m and the turns in rad.
    """
    arms = predicted - predicted.mean(axis=0)
    columns = [np.tile([0.0, 1.0, 0.0], (3, 1)), np.cross([1.0, 0.0, 0.0], arms), np.cross([0.0, 0.0, 1.0], arms)]
    design = np.array([column.ravel() for column in columns]).T
    x, *_ = np.linalg.lstsq(design, (measured - predicted).ravel(), rcond=None)
    return predicted + (design @ x).reshape(3, 3), x


@dataclasses.dataclass(frozen=True)
class Damping:
    """How the material damps a swing: loss factor; fast and slow: Young's modulus in the bare beam's swing and at rest, in Pa.

    Silicone has nearly the same loss factor at all frequencies. In a simulated motion it is that of a Kelvin-Voigt damping only
    at one frequency, which is the swing's.
    """

    loss: float
    fast: float
    slow: float
    frequency: float  # of the bare beam, in Hz

    def _ratio(self) -> float:
        """Stiffness of each branch over that at rest: together they make the bare beam's swing as stiff as it is."""
        x = 2 * np.pi * self.frequency * np.array(_TIMES)
        return max(self.fast / self.slow - 1.0, 0.0) / float((x**2 / (1.0 + x**2)).sum())

    @property
    def prony(self) -> tuple[PronyTerm, ...]:
        """The series that relaxes from the swing to the rest."""
        ratio = self._ratio()
        return tuple(PronyTerm(ratio / (1.0 + ratio * len(_TIMES)), time) for time in _TIMES) if ratio > 0.0 else ()

    def time(self, frequency: float) -> float:
        """Return the damping time in s for a swing of `frequency` in Hz: what the branches leave of the loss."""
        angular = 2 * np.pi * frequency
        x = angular * np.array(_TIMES)
        branches = self._ratio() * float((x / (1.0 + x**2)).sum())
        return max(self.loss * self.fast / self.slow - branches, 0.0) / angular


def motion_error(recording: Recording, predicted: np.ndarray) -> tuple[float, float]:
    """Return the root mean square distance in m of markers (t, 3, 3) predicted every 10 ms, and the shift of the release in s.

    The hand's release is not recorded exactly: it is shifted by up to 30 ms to the smallest error.
    """
    step, best = 2 * STEP, (np.inf, 0.0)
    flat = predicted.reshape(len(predicted), -1)
    clock = step * np.arange(len(predicted))
    for shift in np.arange(-0.03, 0.0301, 0.002):
        within = (recording.time >= shift) & (recording.time <= shift + clock[-1])
        model = np.array([np.interp(recording.time[within] - shift, clock, column) for column in flat.T]).T.reshape(-1, 3, 3)
        error = recording.markers[within] - model
        best = min(best, (rms_distance(error), float(shift)))
    return best


def _loaded_error(fit: BareFit, recording: Recording, held: np.ndarray, elements: Elements) -> float:
    """Return the worst distance in mm of a marker at rest from where a fit predicts it, registered out of the plane."""
    pose = resting_face(fit.slow, recording.mass, fit.plate, elements)
    fitted, _ = registered(pose.carry(held, recording.held.mean(axis=0) + fit.shift), recording.rest)
    return 1e3 * float(np.linalg.norm(fitted - recording.rest, axis=1).max())


def evaluate(folder: Path, progress: Callable[[str], None], brief: bool) -> Part:
    """Fit to the first bare recording, and predict the loaded ones (brief: at rest only, on a coarse mesh)."""
    recordings = [read(path) for path in sorted(folder.glob("*.csv"))]
    bare = next((r for r in recordings if r.mass == 0.0), None)
    if bare is None:
        raise MeasurementError(f"{folder}: contains no recording gravity_*.csv, to which the modulus is fitted")
    mesh = COARSE if brief else _FINE
    progress("modulus")
    swings = {r.name: swing(r) for r in recordings}
    fit = fit_bare(bare, swings[bare.name], mesh)
    rest = {mass: resting_face(fit.slow, mass, fit.plate, mesh) for mass in sorted({r.mass for r in recordings})}
    rows, error, vertical, held = [], {}, {}, {}
    corrections, hands = {}, {}
    for recording in recordings:
        free = swings[recording.name]
        held[recording.name] = hand_removed(recording, free)
        plain = rest[recording.mass].carry(held[recording.name], recording.held.mean(axis=0) + fit.shift)
        fitted, aside = registered(plain, recording.rest)
        corrections[recording.name] = fitted - plain
        error[recording.name] = 1e3 * np.linalg.norm(fitted - recording.rest, axis=1)
        unregistered = 1e3 * np.linalg.norm(plain - recording.rest, axis=1)
        vertical[recording.name] = 1e3 * float((plain - recording.rest)[:, 0].mean())
        turns = np.degrees([aside[1], hand_turn(recording, free), aside[2]])
        hands[recording.name] = {"aside_mm": 1e3 * float(aside[0]), "turn_deg": turns.tolist()}
        travel = 1e3 * (recording.rest - recording.held).mean(axis=0)
        rows.append(
            (
                recording.name, f"{travel[0]:.2f}, {travel[1]:.2f}, {travel[2]:.2f}", vertical[recording.name],
                float(error[recording.name].max()), float(unregistered.max()), 1e3 * float(aside[0]),
                ", ".join(f"{turn:.2f}" for turn in turns),
            )
        )  # fmt: skip
    loaded = [r for r in recordings if r.mass > 0.0]
    worst = float(max((error[r.name].max() for r in loaded), default=np.nan))
    bare_plate = fit_bare(bare, swings[bare.name], mesh, NO_PLATE)
    without = max((_loaded_error(bare_plate, r, held[r.name], mesh) for r in loaded), default=np.nan)
    heaviest = max((r.mass for r in loaded), default=0.0)
    interval = 1e3 * prediction_interval(fit, heaviest, mesh) if heaviest else np.nan
    moved = ""
    if loaded:
        moved = (
            f" What it leaves open of modulus and plate moves the heaviest loaded beam by ± {interval:.1f} mm (95 %); without a"
            f" plate the worst marker under load is off by {without:.2f} mm."
        )
    aside_mm = float(np.sqrt(np.mean([hand["aside_mm"] ** 2 for hand in hands.values()])))
    part = Part(
        figures=[
            Figure(
                f"beam: markers at rest under load, worst, {1e3 * PLATE:g} ± {1e3 * PLATE:g} g of plate assumed",
                worst,
                "mm",
                "2.0 mm, the mean marker with their modulus",
                0.8,
            ),
            Figure("beam: the same without a plate", without, "mm"),
        ][: 2 * len(loaded)],
        parts=[
            Table(
                "Beam: at rest",
                (
                    "recording",
                    "mean travel measured, mm",
                    "vertical error, mean, mm",
                    "marker error, worst, mm",
                    "the same, not registered out of the plane, mm",
                    "held aside by the hand, mm",
                    "turned by the hand about x, y, z, degrees",
                ),
                rows,
                "Registered: one shift and two turns out of the plane of bending for each recording. The hand's turn about y"
                " follows from the free swing.",
            ),
            error_bars("Beam: error of each marker at rest", ["1", "2", "3"], error, "Registered out of the plane of bending."),
        ],
        notes=[
            f"beam: the mass of the plate with the markers is not written down; {1e3 * PLATE:g} ± {1e3 * PLATE:g} g are assumed,"
            f" and the bare beam leaves it open.{moved}",
            *(
                f"beam: {r.name}: {r.mistaken} instants are left out, at which the markers do not keep their distances"
                for r in recordings
                if r.mistaken
            ),
            f"beam: the hand holds the face aside by {aside_mm:.1f} mm (RMS of the recordings). Its error in height is not"
            " measured, and remains in the error of the markers at rest.",
        ],
        data={
            "beam_rest_mm": worst, "beam_rest_interval_mm": interval, "beam_rest_without_plate_mm": without,
            "beam_vertical_mm": vertical, "beam_modulus_kpa": 1e-3 * fit.slow,
            "beam_aside_mm": aside_mm, "beam_hand": hands,
        },
    )  # fmt: skip
    estimates = fit.estimates
    if not brief:
        free = swings[bare.name]
        coarse = fit_bare(bare, free, COARSE)  # whose motion is right for what was fitted with the same mesh
        damping = Damping(free.loss, coarse.fast, coarse.slow, free.frequency)
        estimates = [*fit.estimates, PoseEstimate("loss factor", "", np.nan, damping.loss, np.nan)]
        estimates += [PoseEstimate(f"Prony term of {term.time:g} s", "", 0.0, term.share, np.nan) for term in damping.prony]
        predicted = {}
        for recording in recordings:
            progress(f"motion of {recording.name}")
            time = damping.time(frequency(coarse.fast, recording.mass, coarse.plate))
            poses = motion(beam(coarse.slow, recording.mass, coarse.plate, COARSE, time, damping.prony), _SHOWN)
            middle = recording.held.mean(axis=0) + coarse.shift
            places = np.array([pose.carry(held[recording.name], middle) for pose in poses])
            predicted[recording.name] = places + corrections[recording.name]
        _add_motion(part, recordings, predicted, free)
    part.parts.insert(
        0, fitted_table("Beam: fitted to the bare beam", estimates, f"The authors' modulus: {1e-3 * THEIRS:g} kPa.")
    )
    return part


def _add_motion(part: Part, recordings: list[Recording], predicted: dict[str, np.ndarray], free: Swing) -> None:
    """Add figures, plot and data of the motion to the part. predicted: markers (t, 3, 3) every 2 steps, by recording."""
    errors = {}
    with Drawing(1, len(recordings), width=4.2 * len(recordings), height=3.0, squeeze=False) as drawing:
        for axes, recording in zip(drawing.axes[0], recordings):
            places = predicted[recording.name]
            error, release = motion_error(recording, places)
            errors[recording.name] = 1e3 * error
            within = (recording.time > -0.2) & (recording.time < _SHOWN)
            axes.plot(
                recording.time[within] - release,
                1e3 * (recording.markers - recording.held).mean(axis=1)[within, 0],
                color=REAL,
                label="measured",
            )
            clock = 2 * STEP * np.arange(len(places))
            axes.plot(clock, 1e3 * (places - recording.held).mean(axis=1)[:, 0], color=MODEL, linewidth=1.0, label="predicted")
            axes.set_title(recording.name)
            axes.set_xlabel("time in s")
        drawing.axes[0, 0].set_ylabel("height in mm")
        drawing.axes[0, 0].legend()
    caption = f"Mean of the markers. The bare beam swings at {free.frequency:.2f} Hz and decays at {free.decay:.2f} 1/s."
    part.parts.append(Plot("Beam: motion", drawing.svg, caption))
    worst = max(errors.values())
    part.figures.append(Figure("beam: markers in the first 3 s after the release, RMS, worst recording", worst, "mm", "", 2.5))
    part.data |= {"beam_motion_mm": worst, "beam_motion_by_recording_mm": errors}
