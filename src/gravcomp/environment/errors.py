"""Errors of building the environment."""


class SetupError(Exception):
    """The environment cannot be built; the text names what is missing and the command that installs it."""
