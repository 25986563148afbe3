"""Parameters of the load cells that the virtual robot imitates."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class VirtualLoadCellParameters:
    """Load cells between capstans and guides."""

    rate: float = parameter(
        0.0, unit="Hz", minimum=0.0, maximum=500.0, description="measurements of the tensions; 0: no load cells", read_only=True
    )
    noise: float = parameter(
        0.01, minimum=0.0, maximum=1.0, description="standard deviation, share of the tension", read_only=True
    )
    floor: float = parameter(
        0.0005, minimum=0.0, maximum=1.0, description="standard deviation without tension, share of limits.tension_max",
        read_only=True,
    )  # fmt: skip
    offset: float = parameter(
        0.0, minimum=0.0, maximum=1.0, description="standard deviation of the zeros, share of limits.tension_max", read_only=True
    )
