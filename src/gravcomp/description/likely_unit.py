"""The unit in which a length was probably given, where it does not suit other lengths of the same robot."""

_UNITS = {"cm": 10.0, "inch": 25.4, "m": 1000.0}
"""Units that are taken for mm, in mm."""

_SHARE = 0.5, 1.02
"""Of the length in the right unit: where a cable probably ends."""


def likely_unit(length: float, reached: float) -> tuple[str, float] | None:
    """Return name and size in mm of the unit in which a robot of `length` would be as long as its cables reach; None: no unit.

    >>> likely_unit(0.008, 0.080)
    ('cm', 10.0)
    """
    for name, size in _UNITS.items():
        if _SHARE[0] < reached / (size * length) <= _SHARE[1]:
            return name, size
    return None
