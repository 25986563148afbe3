"""How well a run kept the robot's shape: from the truth of a running graph, from the CAN bus, or from a recorded bag (`recorded`)."""
