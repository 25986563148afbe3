"""The step of a first-order lag: how corrections and loads come and go without a jump."""

import math


def lag_share(before: float, now: float, time_constant: float) -> float:
    """Return the share of the way to the wanted value that is gone from `before` to `now` (s), by the implicit Euler method.

    before: -inf for the first step, which goes no way unless time_constant (s) is 0. Time that runs backwards counts as none.
    """
    interval = max(0.0, now - before) if math.isfinite(before) else 0.0
    return interval / (interval + time_constant) if interval + time_constant > 0.0 else 1.0
