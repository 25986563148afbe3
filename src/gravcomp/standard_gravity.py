"""Standard gravity, by which sensors and the virtual robot count in g."""

STANDARD_GRAVITY = 9.80665
"""m/s^2 (third General Conference on Weights and Measures, 1901)."""
