"""Wrenches on the robot as another node knows them: checked against frame, time and the robot's limits, ramped, and dropped.

The frame says both the axes and the section: in that of the tip or of a backbone point the wrench acts there and turns with it;
in soft_base it acts on the tip in fixed axes. Any other frame is refused.
"""

import dataclasses
import math

import numpy as np

from gravcomp.description import Robot
from gravcomp.external_loads.options import ExternalLoadOptions
from gravcomp.first_order_lag import lag_share
from gravcomp.full_model.wrench import Wrench


@dataclasses.dataclass
class _Load:
    """A wrench of one frame: wanted now and as the model has it; arrival in s of the node's clock."""

    wanted: Wrench
    arrival: float
    force: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    moment: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))


class WrenchInput:
    """Takes wrenches for one robot; each frame carries one, the newest."""

    def __init__(self, robot: Robot, options: ExternalLoadOptions, base_frame: str = "soft_base", tip_frame: str = "soft_tip"):
        self._limit, self.options = robot.max_wrench, options
        self._stations: dict[str, tuple[float, bool]] = {base_frame: (1.0, False), tip_frame: (1.0, True)}
        for index, station in enumerate(robot.effectors.backbone_station):
            self._stations[f"{base_frame}_backbone_{index}"] = float(station), True
        self.reset()

    def reset(self) -> None:
        """Drop all loads."""
        self._loads: dict[str, _Load] = {}
        self._last, self.used, self.refused, self.refusal = -math.inf, 0, 0, ""
        self._stale = ""
        self._at = -math.inf

    def take(self, stamp: float, now: float, frame: str, force: np.ndarray, moment: np.ndarray) -> bool:
        """Take a wrench: stamp and now in s, force (3,) in N and moment (3,) in N m; return whether it is used.

        `refusal` says why it is not; then the load of this frame goes on until it is stale.
        """
        self.refusal = self._objection(stamp, now, frame, force, moment)
        if self.refusal:
            self.refused += 1
            return False
        self.used += 1
        wanted = Wrench(force, moment, *self._stations[frame])
        if frame in self._loads:
            self._loads[frame].wanted, self._loads[frame].arrival = wanted, now
        else:
            self._loads[frame] = _Load(wanted, now)
        return True

    def wrenches(self, now: float) -> tuple[Wrench, ...]:
        """Return the loads that the model carries at `now` (s), ramped since the last call."""
        time = self.options.ramp_time
        share = lag_share(self._at, now, time)
        self._at = now
        found, self._stale = [], ""
        for frame, load in list(self._loads.items()):
            stale = now - load.arrival > self.options.stale_after
            if stale:
                self._stale = f"no external/wrench in the frame '{frame}' for {now - load.arrival:.1f} s: its load is taken away"
            wanted_force, wanted_moment = (np.zeros(3), np.zeros(3)) if stale else (load.wanted.force, load.wanted.moment)
            load.force = load.force + share * (wanted_force - load.force)
            load.moment = load.moment + share * (wanted_moment - load.moment)
            if stale and now - load.arrival > self.options.stale_after + 10.0 * time:
                del self._loads[frame]
                continue
            found.append(dataclasses.replace(load.wanted, force=load.force, moment=load.moment))
        return tuple(found)

    @property
    def sentence(self) -> str:
        """What the user has to know, empty while all is well."""
        return f"external/wrench is refused: {self.refusal}" if self.refusal else self._stale

    def _objection(self, stamp: float, now: float, frame: str, force: np.ndarray, moment: np.ndarray) -> str:
        """Return what is wrong with a wrench, empty for nothing."""
        if self._limit is None:
            return "the robot file has no robot.max_wrench: the robot carries no external load"
        if frame not in self._stations:
            return f"it is in the frame '{frame}', which is not known; allowed: {', '.join(self._stations)}"
        if not (np.isfinite(force).all() and np.isfinite(moment).all()):
            numbers = ", ".join(f"{value:g}" for value in [*force, *moment])
            return f"it has the numbers {numbers}; finite numbers are needed"
        if not math.isfinite(stamp) or stamp == 0.0:
            return "it has no stamp"
        if stamp > now + self.options.ahead:
            return f"its stamp is {stamp - now:.2f} s ahead: the clocks are not synchronised"
        if now - stamp > self.options.stale_after:
            return f"it is {now - stamp:.2f} s old; at most {self.options.stale_after:g} s are allowed (external.stale_after)"
        return self._limit.objection(float(np.linalg.norm(force)), float(np.linalg.norm(moment)))
