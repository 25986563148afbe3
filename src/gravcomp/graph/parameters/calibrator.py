"""Parameters of the node calibrator."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class CalibratorParameters:
    """Parameters of the node."""

    plan: str = parameter("", unit="path", read_only=True, description="plan from ./gravcomp calibrate --live")
    out: str = parameter("", unit="path", read_only=True, description="CSV file of the measured poses, continued if it is there")
    state_file: str = parameter(
        "", unit="path", read_only=True, description="JSON file with what to do now, rewritten as it changes; empty: none"
    )
    tip_topic: str = parameter("measured/tip", read_only=True, description="topic of the measured tip")
