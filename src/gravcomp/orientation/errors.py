"""Errors of the calibration from recordings."""

from gravcomp.config import ConfigError


class CalibrationError(ConfigError):
    """A recording that does not determine what is calibrated; the text says what is missing."""
