"""What the compiler may do to sums: reassociate them, so that it can use vector instructions; NaN keeps its meaning."""

REORDERED = {"reassoc", "contract", "nsz", "arcp"}
"""For Numba's `fastmath`."""
