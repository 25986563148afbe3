"""Result of one folder of measurements."""

import dataclasses
from typing import Any

from gravcomp.report.result import Figure, Plot, Table


@dataclasses.dataclass
class Part:
    """Figures, tables, plots, notes and data (for JSON) of one folder."""

    figures: list[Figure]
    parts: list[Table | Plot] = dataclasses.field(default_factory=list)
    notes: list[str] = dataclasses.field(default_factory=list)
    data: dict[str, Any] = dataclasses.field(default_factory=dict)
