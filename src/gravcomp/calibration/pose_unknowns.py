"""The unknowns that a mapping's `fit` stands for."""

from collections.abc import Sequence

import numpy as np

from gravcomp.calibration.measured import MeasurementError
from gravcomp.calibration.pose_fit import MODULUS, PosePriors, PoseUnknown, base_unknowns, tension_gain
from gravcomp.description import Robot


def unknowns_of(fit: Sequence[str], robot: Robot) -> tuple[PoseUnknown, ...]:
    """Return the unknowns of the entries of `fit`, in the order of `mapping.FITTED`.

    Raises MeasurementError for cables that a fit cannot move.
    """
    names, priors = robot.cable_names, PosePriors()
    for cable in robot.cables:
        if cable.via_points is not None and ("angles" in fit or "tip_radius" in fit):
            raise MeasurementError(
                f"cable '{cable.name}' has via_points_mm; a fit moves only cables with angle_deg and radius_mm"
            )
        if cable.follow_taper and "tip_radius" in fit:
            raise MeasurementError(f"cable '{cable.name}' has follow_taper; a fit of its radius needs tip_radius_mm instead")
    found: list[PoseUnknown] = []
    if "modulus" in fit:
        found.append(MODULUS)
    if "gain" in fit:
        found.append(tension_gain(priors))
    if "gain_per_cable" in fit:
        found += [tension_gain(priors, index, f"gain of {name}") for index, name in enumerate(names)]
    if "zeros" in fit:
        found += [
            PoseUnknown(f"zero of {name}", "mm", "zero", index, priors.zero_share * robot.length, 1e3)
            for index, name in enumerate(names)
        ]
    if "angles" in fit:
        found += [
            PoseUnknown(f"angle of {name}", "deg", "angle", index, priors.angle, 180 / np.pi) for index, name in enumerate(names)
        ]
    if "tip_radius" in fit:
        scale = priors.radius * max(cable.radius or 0.0 for cable in robot.cables)
        found.append(PoseUnknown("pitch radius at the cables' ends", "mm", "tip_radius", None, scale, 1e3))
    if "base" in fit:
        found += base_unknowns(robot, priors)
    return tuple(found)
