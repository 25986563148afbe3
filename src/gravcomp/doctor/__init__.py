"""Checks of the machine, a robot file, a CAN bus and a running graph; each returns findings."""
