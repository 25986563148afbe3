"""Parameters of the node fault_probe."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class FaultProbeParameters:
    """What can be set on the node."""

    seed: int = parameter(1, minimum=0, maximum=2**31 - 1, read_only=True, description="of the hostile messages")
