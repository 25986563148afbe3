"""Parameters of the tracker that the virtual robot imitates."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class VirtualTrackerParameters:
    """A tracker of the tip with noise, latency and faults."""

    rate: float = parameter(
        0.0, unit="Hz", minimum=0.0, maximum=100.0, description="measurements of the tip; 0: no tracker", read_only=True
    )
    delay: float = parameter(
        100.0, edge="ms", minimum=0.0, maximum=2000.0, description="from a measurement to its arrival", read_only=True
    )
    std: float = parameter(
        0.5, edge="mm", minimum=0.0, maximum=100.0, description="standard deviation along each axis", read_only=True
    )
    dropouts: float = parameter(0.0, minimum=0.0, maximum=1.0, description="share of measurements that are lost", read_only=True)
    outliers: float = parameter(
        0.0, minimum=0.0, maximum=1.0, description="share of measurements anywhere within the robot's length", read_only=True
    )
