"""CAN: the frames (gravcomp.dbc, FRAMES.md), their codec, and buses that come back after an error."""
