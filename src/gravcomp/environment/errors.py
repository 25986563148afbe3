"""What can stand in the way of the environment."""


class SetupError(Exception):
    """The environment cannot be made; the text says what is missing and the line that mends it."""
