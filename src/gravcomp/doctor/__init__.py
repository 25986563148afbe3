"""Examinations of the machine, a robot's file, a bus and a running graph, each giving findings."""
