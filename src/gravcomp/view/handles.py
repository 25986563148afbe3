"""Reading and setting the value of a control."""

import math
from typing import Any


def number(handle: Any) -> float:
    """Return the number of a slider; NaN where a browser has set something else."""
    value = handle.value
    return float(value) if isinstance(value, int | float) else math.nan


def set_value(handle: Any, value: object) -> None:
    """Set the value of a viser input handle. viser's type stubs declare `value` as read-only, but its setter is documented."""
    handle.value = value
