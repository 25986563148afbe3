"""Evaluation of runs: from the ground truth of a running graph, from the CAN bus, and from a recorded bag (`recorded`)."""
