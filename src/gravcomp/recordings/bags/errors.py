"""Errors of bags."""

from gravcomp.config import ConfigError


class BagError(ConfigError):
    """A bag that cannot be written or read; the text is for the user."""
