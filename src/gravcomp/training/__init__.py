"""Training of a robot's reduced model: samples of the full model in the closed loop, basis, strain polynomials, test."""

from gravcomp.training.build import BuildOptions, build
from gravcomp.training.samples import TrainingOptions

__all__ = ["BuildOptions", "TrainingOptions", "build"]
