"""Setting the value of a control."""

from typing import Any


def set_value(handle: Any, value: object) -> None:
    """Set the value of a viser input handle. viser's type stubs declare `value` as read-only, but its setter is documented."""
    handle.value = value
