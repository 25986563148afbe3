"""Correction of the model's slow error (creep, hysteresis, wrong modulus) by a measured position of the tip."""

from gravcomp.tip_observer.observer import TipObserver, TrackerState, TrackerStatus
from gravcomp.tip_observer.options import TipObserverOptions

__all__ = ["TipObserver", "TipObserverOptions", "TrackerState", "TrackerStatus"]
