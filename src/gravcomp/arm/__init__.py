"""The arm that carries the robot: where its joints put the robot's base, and so gravity in it."""
