"""filterpy is imported without scipy.stats, and its densities work nevertheless."""

import subprocess
import sys

PROGRAM = """
import sys
import numpy
from gravcomp.orientation.filterpy_import import kalman_filter_class
kalman = kalman_filter_class()(dim_x=1, dim_z=1)
kalman.update(1.0, H=numpy.eye(1))
assert "scipy.stats" not in sys.modules
import scipy.stats
from filterpy.stats import logpdf
assert abs(kalman.log_likelihood - scipy.stats.norm.logpdf(1.0, 0.0, 2.0**0.5)) < 1e-12
assert logpdf([1.0], [0.0], [[2.0]]) == kalman.log_likelihood
"""


def test_the_filter_does_not_load_scipy_stats_and_the_densities_load_it_when_used():
    done = subprocess.run([sys.executable, "-W", "error", "-c", PROGRAM], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
