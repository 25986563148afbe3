"""A person who steers a robot: what is seen in the picture of a camera at its tip, and what the hand does.

scene, tip -> `picture`: places in the picture -> `person`: bend of the tip, speed along the axis -> `handle`: pose of the base
"""
