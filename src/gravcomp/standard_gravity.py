"""Standard gravity, by which sensors and the virtual robot count in g, and the largest gravity that a model is asked for."""

STANDARD_GRAVITY = 9.80665
"""m/s^2 (third General Conference on Weights and Measures, 1901)."""

LARGEST_GRAVITY = 100.0
"""m/s^2; more is in another unit, or no gravity that a robot meets."""
