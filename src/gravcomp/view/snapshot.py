"""State of the graph at one instant, as the page shows it."""

import dataclasses

import numpy as np

from gravcomp.view.backbone import Backbone
from gravcomp.view.touches import Touch


@dataclasses.dataclass(frozen=True)
class TargetView:
    """A target: its tip, and its curve if the target gives the whole shape."""

    tip: np.ndarray  # (3,) m
    curve: Backbone | None = None


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """The newest of every stream, in soft_base and SI units. Unknown values are None or empty."""

    time: float  # s, time axis of the plots
    backbone: Backbone | None = None  # of the model
    gravity: np.ndarray | None = None  # (3,) m/s^2
    tension: np.ndarray | None = None  # (m,) N, of the model
    displacement: np.ndarray | None = None  # (m,) m, of the model
    model: str = ""
    model_time: float = 0.0  # s, of one step of the model
    motors_tension: np.ndarray | None = None  # (m,) N, from the motors' currents
    motors_state: str = ""  # of the bridge: a state of the message CableState in lower case
    motors_message: str = ""  # reason for the state
    truth: Backbone | None = None  # of the virtual robot
    target: TargetView | None = None
    status: str = ""  # sentence of the controller
    status_level: str = "off"  # off, ok, warn, error
    rate: float = 0.0  # Hz, of the model
    delays: dict[str, float] = dataclasses.field(default_factory=dict)  # s since the IMU sample, by stage
    recording: str = ""  # path of the bag that is being recorded
    virtual: bool = False  # a virtual robot runs
    model_touches: tuple[Touch, ...] = ()  # forces of walls on the model
    virtual_touches: tuple[Touch, ...] = ()  # forces of walls and of a hand on the virtual robot
    load: Touch | None = None  # the estimated load at the tip
    load_deviation: float = 0.0  # N, standard deviation of the estimated force
    wall: tuple[np.ndarray, np.ndarray] | None = None  # point (3,) m and normal (3,) of the wall that the user has placed

    @property
    def tip_error(self) -> float:
        """Distance (m) from the model's tip to the target; NaN when unknown."""
        return _distance(self.backbone, self.target)

    @property
    def true_tip_error(self) -> float:
        """Distance (m) from the virtual robot's tip to the target; NaN when unknown."""
        return _distance(self.truth, self.target)

    @property
    def model_error(self) -> float:
        """Distance (m) from the model's tip to the virtual robot's; NaN when unknown."""
        if self.backbone is None or self.truth is None:
            return float("nan")
        return float(np.linalg.norm(self.backbone.tip - self.truth.tip))


def _distance(backbone: Backbone | None, target: TargetView | None) -> float:
    if backbone is None or target is None:
        return float("nan")
    return float(np.linalg.norm(backbone.tip - target.tip))
