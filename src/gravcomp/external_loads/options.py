"""Parameters of external loads."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class ExternalLoadOptions:
    """What is accepted on external/wrench, and how fast loads come and go in the model."""

    stale_after: float = parameter(
        0.5, unit="s", minimum=0.01, maximum=3600.0,
        description="without a new wrench for this time, or with one that is older, its load is taken away",
    )  # fmt: skip
    ramp_time: float = parameter(
        0.3, unit="s", minimum=0.0, maximum=60.0, description="time constant with which loads come and go in the model"
    )
    ahead: float = parameter(
        0.05, unit="s", minimum=0.0, maximum=10.0, description="by how much a stamp may be ahead of the node's clock"
    )


@dataclasses.dataclass(frozen=True)
class BaseTurnOptions:
    """Whether the forces of the base's turns act on the model, and how smooth they are."""

    enabled: bool = parameter(
        True,
        read_only=True,
        description="forces of the base's turns, from the rate in imu/data, act on the model; not in a scene",
    )
    lag: float = parameter(
        0.1, minimum=0.01, maximum=10.0, description="time of the low-pass of the rate, over the robot's first period"
    )
