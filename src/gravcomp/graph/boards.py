"""The boards that a running graph may have. The command line lists them, so that this module imports nothing."""

BOARDS = ("virtual", "emulated", "standalone")
"""What stands in for the board: Python code on the bus of the motors, the firmware's C code between host and motors, or that
with the loop on the board."""
