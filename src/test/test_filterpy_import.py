"""filterpy is imported without scipy.stats and scipy.ndimage, and what uses them works nevertheless."""

import subprocess
import sys

PROGRAM = """
import sys
import numpy
from gravcomp.orientation.filterpy_import import kalman_filter_class
kalman = kalman_filter_class()(dim_x=1, dim_z=1)
kalman.update(1.0, H=numpy.eye(1))
assert not {"scipy.stats", "scipy.ndimage"} & set(sys.modules)
import scipy.stats
from filterpy.stats import logpdf
assert abs(kalman.log_likelihood - scipy.stats.norm.logpdf(1.0, 0.0, 2.0**0.5)) < 1e-12
assert logpdf([1.0], [0.0], [[2.0]]) == kalman.log_likelihood
from filterpy.discrete_bayes import predict
assert predict([1.0, 0.0, 0.0], offset=1, kernel=[1.0]).tolist() == [0.0, 1.0, 0.0]
"""


def test_the_filter_does_not_load_what_it_does_not_use_and_the_rest_loads_it_when_used():
    done = subprocess.run([sys.executable, "-W", "error", "-c", PROGRAM], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
