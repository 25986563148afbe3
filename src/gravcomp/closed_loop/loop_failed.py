"""The error of a loop that cannot be run."""


class LoopFailed(RuntimeError):
    """The bridge does not start, or refuses a command: these motors cannot drive this robot."""
