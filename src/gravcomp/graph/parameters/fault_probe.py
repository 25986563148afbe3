"""Parameters of gravcomp_hw.fault_probe."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class FaultProbeParameters:
    """Parameters of the module."""

    seed: int = parameter(1, minimum=0, maximum=2**31 - 1, read_only=True, description="seed of the hostile messages")
