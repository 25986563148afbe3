"""The arm that carries the robot: its kinematics, from joint positions to gravity in the robot's base, and its tour."""
