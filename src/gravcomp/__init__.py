"""gravcomp: gravity compensation for soft slender robots. The core: everything that computes, without ROS."""

from gravcomp.numba_cache import configure_numba

__version__ = "0.1.0"

configure_numba()
