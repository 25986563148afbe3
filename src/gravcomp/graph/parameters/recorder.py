"""Parameters of the node recorder."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class RecorderParameters:
    """What is recorded, and where to."""

    out: str = parameter("", unit="path", read_only=True, description="folder of the bag; it must not exist yet")
    topics: tuple[str, ...] = parameter(
        (),
        read_only=True,
        description="topics, absolute or below the node's namespace; empty: all of the namespace and all global ones",
    )
    flush_interval: float = parameter(
        1.0, unit="s", minimum=0.05, maximum=60.0, read_only=True, description="what a kill may lose"
    )
