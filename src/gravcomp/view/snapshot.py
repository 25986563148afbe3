"""What the page shows at one instant: the newest of every stream."""

import dataclasses

import numpy as np

from gravcomp.view.backbone import Backbone


@dataclasses.dataclass(frozen=True)
class TargetView:
    """A target as a curve where the whole shape is asked for, else its tip alone."""

    tip: np.ndarray  # (3,) m
    curve: Backbone | None = None


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """Frame soft_base, SI. What is not known is None or empty."""

    time: float  # s, of the plots; never goes back
    backbone: Backbone | None = None  # as modelled
    gravity: np.ndarray | None = None  # (3,) m/s^2
    tension: np.ndarray | None = None  # (m,) N, as modelled
    displacement: np.ndarray | None = None  # (m,) m, as modelled
    model: str = ""
    model_time: float = 0.0  # s, of one step of the model
    motors_tension: np.ndarray | None = None  # (m,) N, from the motors' currents
    motors_state: str = ""  # of the bridge, as its message CableState names it, in small letters
    motors_message: str = ""  # why
    truth: Backbone | None = None  # of the virtual robot
    target: TargetView | None = None
    status: str = ""  # the controller's sentence
    status_level: str = "off"  # off, ok, warn, error
    rate: float = 0.0  # Hz, of the model
    delays: dict[str, float] = dataclasses.field(default_factory=dict)  # s since the IMU sample, by stage
    recording: str = ""  # where a bag is being written
    virtual: bool = False  # a virtual robot listens

    @property
    def tip_error(self) -> float:
        """m, modelled tip to target; NaN when unknown."""
        return _distance(self.backbone, self.target)

    @property
    def true_tip_error(self) -> float:
        """m, the virtual robot's tip to target; NaN when unknown."""
        return _distance(self.truth, self.target)

    @property
    def model_error(self) -> float:
        """m, modelled tip to the virtual robot's; NaN when unknown."""
        if self.backbone is None or self.truth is None:
            return float("nan")
        return float(np.linalg.norm(self.backbone.tip - self.truth.tip))


def _distance(backbone: Backbone | None, target: TargetView | None) -> float:
    if backbone is None or target is None:
        return float("nan")
    return float(np.linalg.norm(backbone.tip - target.tip))
