"""The firmware of the board: building its C code for this machine and for the chip, running it here, emulating its image."""
