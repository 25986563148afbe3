"""gravcomp: gravity compensation for soft slender robots. The core: everything that computes, without ROS."""

__version__ = "0.1.0"
