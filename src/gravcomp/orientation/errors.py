"""Errors of the calibration from recordings."""


class CalibrationError(ValueError):
    """A recording that does not determine what is calibrated; the text says what is missing."""
