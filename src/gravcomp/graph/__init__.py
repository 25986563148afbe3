"""The graph as data: its nodes and their parameters, without ROS."""
