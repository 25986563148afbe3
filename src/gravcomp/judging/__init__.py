"""Judging a running graph by the truth that the loop does not know: figures from what was seen, delays from the bus."""
