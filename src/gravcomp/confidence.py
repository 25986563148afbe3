"""Half widths of confidence intervals, by Student's t.

`scipy.special` has the quantile that `scipy.stats` wraps, which takes a second to import.
"""


def half_width(freedom: int, confidence: float = 0.95) -> float:
    """Return half the width of the two-sided interval in standard deviations, estimated with `freedom` degrees of freedom."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * confidence))
