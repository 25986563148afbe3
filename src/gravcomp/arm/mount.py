"""The mount of the IMU on an arm, from rests in several poses: hand-eye calibration in rotation.

At rest k the IMU measures the direction u_k against gravity in its own frame, and the arm knows the rotation R_k of soft_base in
its world. Sought is the mount M (IMU to soft_base), on request with a tilt B of the arm's world against the vertical:

    M u_k = R_k^T B e_z,      minimised over M = exp(m) M_0 and B = exp((b_x, b_y, 0))

(R. Tsai, R. Lenz, "A new technique for fully autonomous and efficient 3D robotics hand/eye calibration", IEEE T-RA 1989, for
directions instead of motions). Intervals: the inverse of J^T J times the residual's variance, by Student's t.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.confidence import half_width
from gravcomp.orientation.errors import CalibrationError
from gravcomp.orientation.known_directions import check_directions
from gravcomp.orientation.resting_poses import DISTINCT

CONFIDENCE = 0.95
"""Of the intervals."""

_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Mount:
    """roll, pitch, yaw: of the IMU in soft_base (rad). interval (3,): half widths about x, y, z of soft_base (rad).

    tilt (2,): of the arm's world about its x and y (rad), with tilt_interval (2,), None where it is not fitted; residual (k,):
    angles between measured and expected directions (rad).
    """

    roll: float
    pitch: float
    yaw: float
    interval: np.ndarray
    tilt: np.ndarray | None
    tilt_interval: np.ndarray | None
    residual: np.ndarray

    @property
    def rotation(self) -> Rotation:
        """Rotation from the IMU to soft_base."""
        return Rotation.from_euler("xyz", [self.roll, self.pitch, self.yaw])


def fit_mount(accel: np.ndarray, base: np.ndarray, *, with_tilt: bool = False) -> Mount:
    """Return the mount from k rests.

    accel (k, 3): mean specific forces in the IMU's frame; base (k, 3, 3): rotations of soft_base in the arm's world. Raises
    CalibrationError where the rests do not determine what is sought, and where no mount fits them.
    """
    from scipy.optimize import least_squares

    up = np.asarray(accel, float) / np.linalg.norm(accel, axis=1, keepdims=True)
    unknown, equations = (5 if with_tilt else 3), 2 * len(up)
    if equations <= unknown:
        raise CalibrationError(
            f"{len(up)} pose(s) at rest; at least {unknown // 2 + 1} are needed" + (" for mount and tilt" if with_tilt else "")
        )
    known = np.einsum("kji,j->ki", base, _UP)
    if np.linalg.svd(known, compute_uv=False)[1] < math.sin(DISTINCT):
        raise CalibrationError(
            f"in all {len(up)} poses gravity is along one line of soft_base, which does not determine the rotation about this"
            " line; turn the flange by 15 deg or more"
        )
    start, _ = Rotation.align_vectors(known, up)

    def directions(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        world = Rotation.from_rotvec([x[3], x[4], 0.0]).apply(_UP) if with_tilt else _UP
        return (Rotation.from_rotvec(x[:3]) * start).apply(up), np.einsum("kji,j->ki", base, world)

    def residuals(x: np.ndarray) -> np.ndarray:
        measured, expected = directions(x)
        return np.cross(measured, expected).ravel()

    solution = least_squares(residuals, np.zeros(unknown))
    normal = solution.jac.T @ solution.jac
    if np.linalg.cond(normal) > 1.0 / math.sin(DISTINCT) ** 8:
        raise CalibrationError(
            f"the {len(up)} poses do not determine mount and tilt together; rest in more directions of the flange"
        )
    check_directions(*directions(solution.x))
    freedom = equations - unknown
    width = half_width(freedom, CONFIDENCE) * math.sqrt(2.0 * solution.cost / freedom)
    half = width * np.sqrt(np.diag(np.linalg.inv(normal)))
    measured, expected = directions(solution.x)
    roll, pitch, yaw = (Rotation.from_rotvec(solution.x[:3]) * start).as_euler("xyz").tolist()
    return Mount(
        roll, pitch, yaw,
        interval=half[:3],
        tilt=solution.x[3:] if with_tilt else None,
        tilt_interval=half[3:] if with_tilt else None,
        residual=np.arctan2(np.linalg.norm(np.cross(measured, expected), axis=1), np.sum(measured * expected, axis=1)),
    )  # fmt: skip
