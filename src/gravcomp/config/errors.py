"""The error of the configuration."""


class ConfigError(ValueError):
    """A configuration value is missing, unknown, of the wrong type or out of range.

    The text names file and key, and says what was found and what is allowed. The commands print it to the user as it is.
    """
