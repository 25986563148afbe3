"""A hanging soft cone with two cables: modulus, tension gains, cable places and a rigid offset of the base from all poses."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.calibration.mapping import load_mapping
from gravcomp.calibration.measured import MeasurementError, rms_distance
from gravcomp.calibration.pose_fit import fit_poses, held_out
from gravcomp.calibration.pose_report import error_bars, fitted_table, views
from gravcomp.calibration.pose_table import read_poses
from gravcomp.calibration.pose_unknowns import unknowns_of
from gravcomp.description import Cable, Elements, Material, Robot, Segment
from gravcomp.experiments.measured.folder_table import folder_table
from gravcomp.experiments.measured.part import Part
from gravcomp.report.result import Figure

THEIRS = 22.9  # mm: RMSE over all four markers of the authors' model with nine degrees of freedom
_MAPPING = Path(__file__).with_name("tentacle.yaml")


def robot() -> Robot:
    """Return the cone as its authors describe it; their modulus."""
    material = Material("neo_hookean", 315e3, 0.45, density=1320.0)
    segments = (
        Segment("cone", 0.305, 30.82e-3, tip_outer_diameter=12.84e-3, material=material),
        Segment("end", 0.055, 12.84e-3, tip_outer_diameter=9.6e-3, material=material),
    )
    cables = tuple(
        Cable(f"cable{number}", np.radians(angle), 11.4e-3, tip_radius=(11.4 - 0.0295 * 305) * 1e-3, end=0.305)
        for number, angle in ((1, 30.0), (2, 150.0))
    )
    elements = Elements(around=4, along=18, grading=1.0, equal_stiffness=True)
    return Robot("tentacle", segments=segments, cables=cables, elements=elements)


def evaluate(folder: Path, progress: Callable[[str], None], brief: bool) -> Part:
    """Fit to all poses, and predict each by a fit to the others (brief: each pair)."""
    cone, mapping = robot(), load_mapping(_MAPPING)
    poses = read_poses(folder_table(folder, "poses.csv").path, mapping, cone.cable_names)
    if poses.count < 2:
        raise MeasurementError(
            f"{poses.source}: contains one pose; needed: at least 2, as each is predicted by a fit to the others"
        )
    unknowns = unknowns_of(mapping.fit, cone)
    fit = fit_poses(cone, poses, unknowns, progress=progress)
    count = max(2, poses.count // 2) if brief else poses.count
    folds = [np.arange(poses.count)[k::count] for k in range(count)]
    left_out = held_out(cone, poses, unknowns, folds, start=fit.x, progress=progress)
    inside, outside = fit.predicted - poses.measured, left_out - poses.measured
    by_marker = 1e3 * np.sqrt((inside**2).sum(axis=2).mean(axis=0))
    return Part(
        figures=[
            Figure("tentacle: markers, fitted, RMSE", 1e3 * fit.rms, "mm", f"{THEIRS:g} mm, the authors' model", 8.0),
            Figure(
                "tentacle: markers, each pose predicted by a fit to the others, RMSE", 1e3 * rms_distance(outside), "mm", "", 12.0
            ),
        ],
        parts=[
            views(
                "Tentacle: markers", poses.measured, fit.predicted, "Measured and predicted markers of all poses after the fit."
            ),
            error_bars(
                "Tentacle: error by pose",
                poses.name,
                {
                    "fitted": 1e3 * np.sqrt((inside**2).sum(axis=2).mean(axis=1)),
                    "left out of the fit": 1e3 * np.sqrt((outside**2).sum(axis=2).mean(axis=1)),
                },
                "Root mean square over the four markers.",
            ),
            fitted_table(
                "Tentacle: fitted",
                fit.estimates,
                "RMSE of the markers from the base to the tip: "
                + ", ".join(f"{e:.1f}" for e in by_marker)
                + " mm; the authors' model 11.3, 18.4, 19.2, 35.6 mm.",
            ),
        ],
        notes=[f"tentacle: {sentence}" for sentence in fit.open],
        data={"tentacle_mm": 1e3 * fit.rms, "tentacle_held_mm": 1e3 * rms_distance(outside)},
    )
