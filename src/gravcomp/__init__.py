"""gravcomp: gravity compensation for soft slender robots. This is the core; it knows no ROS."""

__version__ = "0.1.0"
