"""The external force on the tip, or a payload of unknown mass, from measured tips and cable tensions."""

from gravcomp.load_estimation.observer import LoadEstimate, LoadObserver
from gravcomp.load_estimation.options import LoadEstimationOptions

__all__ = ["LoadEstimate", "LoadEstimationOptions", "LoadObserver"]
