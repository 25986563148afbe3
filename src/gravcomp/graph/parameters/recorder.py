"""Parameters of the node recorder."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class RecorderParameters:
    """Parameters of the node."""

    out: str = parameter("", unit="path", read_only=True, description="folder of the bag; it must not exist yet")
    topics: tuple[str, ...] = parameter(
        (),
        read_only=True,
        description="topics, absolute or relative to the namespace; empty: all topics of the namespace and all global ones",
    )
    flush_interval: float = parameter(
        1.0,
        unit="s",
        minimum=0.05,
        maximum=60.0,
        read_only=True,
        description="interval at which data is written to disk; more is not lost when the process is killed",
    )
