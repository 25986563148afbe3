"""What the noise of the tips leaves open after a fit, as a share of what gravity bends the released robot.

The covariance C of x gives the error of each modelled tip: its variance is the trace of J C J^T, with the derivatives J of the
tip by x. Averaged over the poses, that is what a right model misses because of the scatter of the tips to which it was fitted. A
robot that hardly sags is not compensated to a smaller share of its sag than that, whatever else is right.
"""

import numpy as np

from gravcomp.calibration.measured import StillWindows
from gravcomp.calibration.statics import StaticPrediction
from gravcomp.description import Robot
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mesh.coarse import with_coarse_elements

LIMITED = 0.01
"""Share of the sag from which the noise counts as the limit."""

_SLACK = 1e-4  # of the largest tension: a cable with less does not pull


def open_error(by: np.ndarray, covariance: np.ndarray, shares: np.ndarray) -> float:
    """Return the root mean square error of the tips in m, from the derivatives `by` (k, 3, u) and the covariance (u, u) of x.

    shares (k,): weights of the windows.
    """
    squares = np.einsum("kiu,uv,kiv->k", by, covariance, by)
    return float(np.sqrt(np.average(squares, weights=shares)))


def sag_of(robot: Robot, windows: StillWindows, predicted: StaticPrediction) -> float | None:
    """Return the farthest in m that gravity moves the tip of the released robot in the windows; None: it is never released."""
    released = (predicted.tension <= _SLACK * robot.limits.tension_max).all(axis=1)
    if not released.any():
        return None
    model = RobotModel(with_coarse_elements(robot))
    tip = model.mesh.axis.points(np.array([[0.0, 0.0, model.length]]))[0]
    return float(np.linalg.norm(predicted.tip[released, :3] - tip, axis=1).max())


def limited(error: float, sag: float | None) -> str:
    """Return the sentence about a robot that sags too little for its noise; empty: it sags enough, or is never released."""
    if sag is None or error < LIMITED * sag:
        return ""
    return (
        f"the noise of the tips limits this calibration: it leaves {1e3 * error:.2g} mm open, {error / sag:.1%} of the"
        f" {1e3 * sag:.2g} mm that gravity moves the released tip. A residual below that is no error of the model; more poses"
        " (--time), or a tracker with less noise, lower it"
    )
