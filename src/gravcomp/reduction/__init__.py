"""The reduced model: built once a robot, it follows the full one within micrometres at a small part of its cost."""

from gravcomp.reduction.build import BuildOptions, build
from gravcomp.reduction.serving import ReducedServing
from gravcomp.reduction.store import Reduction, load, path_of, why_not
from gravcomp.reduction.training import TrainingOptions

__all__ = ["BuildOptions", "ReducedServing", "Reduction", "TrainingOptions", "build", "load", "path_of", "why_not"]
