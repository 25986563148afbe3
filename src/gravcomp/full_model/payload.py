"""The moment of a payload whose centre is not at the tip itself; its weight is part of the model's."""

import numpy as np

from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.wrench import PointLoads, Wrench


def with_payload(model: MeshedModel, gravity: np.ndarray, loads: PointLoads | None) -> PointLoads | None:
    """Return the loads, and with them the couple of a payload's weight at its centre under gravity (3,)."""
    payload = model.robot.payload
    if not (payload.mass and any(payload.centre)):
        return loads
    weight = payload.mass * np.asarray(gravity, dtype=float)
    couple = Wrench(weight, lever=np.array(payload.centre)), Wrench(-weight)
    return PointLoads(model, (*(loads.wrenches if loads else ()), *couple))
