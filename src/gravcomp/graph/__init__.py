"""The graph as data, without ROS: its nodes with parameters, topics and services."""
