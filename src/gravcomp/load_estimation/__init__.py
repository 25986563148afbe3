"""The external force on the tip, or a payload of unknown mass, from measured tips and cable tensions."""

from gravcomp.load_estimation.anchored_follower import AtOnce, at_once, has_anchored_model
from gravcomp.load_estimation.anchored_model import AnchoredModel
from gravcomp.load_estimation.anchored_process import AnchoredProcess
from gravcomp.load_estimation.estimate import LoadEstimate
from gravcomp.load_estimation.observer import LoadObserver
from gravcomp.load_estimation.options import LoadEstimationOptions

__all__ = [
    "AnchoredModel",
    "AnchoredProcess",
    "AtOnce",
    "LoadEstimate",
    "LoadEstimationOptions",
    "LoadObserver",
    "at_once",
    "has_anchored_model",
]
