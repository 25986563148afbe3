"""The reduced model: tracks the full model within micrometres at a small part of its cost. `gravcomp.training` builds it."""

from gravcomp.reduction.serving import ReducedServing
from gravcomp.reduction.store import Reduction, load, path_of, why_not

__all__ = ["ReducedServing", "Reduction", "load", "path_of", "why_not"]
