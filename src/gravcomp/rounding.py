"""Floating-point rules for compiled sums: the compiler may reassociate them to use vector instructions; NaN keeps its meaning."""

REORDERED = {"reassoc", "contract", "nsz", "arcp"}
"""Value of Numba's `fastmath`."""
