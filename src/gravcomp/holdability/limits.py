"""Limits of the cables for states at rest: without rates, and wider where the question is what would be needed."""

import dataclasses

from gravcomp.description import Limits

_NO_RATE = 1e9


def unlimited_rates(limits: Limits, factor: float = 1.0) -> Limits:
    """Return the limits of tension and displacement times `factor`, without limits of the rates."""
    return dataclasses.replace(
        limits,
        tension_max=factor * limits.tension_max,
        displacement_min=factor * limits.displacement_min,
        displacement_max=factor * limits.displacement_max,
        tension_rate=_NO_RATE,
        displacement_rate=_NO_RATE,
    )
