"""The sense of gravity: orientation of an IMU from its gyroscope and accelerometer, and gravity in the robot's base frame."""

from gravcomp.orientation.bias_model import BiasModelError, BiasTemperatureModel
from gravcomp.orientation.calibration import ImuCalibration
from gravcomp.orientation.estimator import EstimatorOptions, GravityEstimate, GravityEstimator
from gravcomp.orientation.filter import Estimate, OrientationFilter
from gravcomp.orientation.guard import Problem
from gravcomp.orientation.offline import EstimatedRecording, estimate_recording
from gravcomp.orientation.options import FilterOptions

__all__ = [
    "BiasModelError",
    "BiasTemperatureModel",
    "Estimate",
    "EstimatedRecording",
    "EstimatorOptions",
    "FilterOptions",
    "GravityEstimate",
    "GravityEstimator",
    "ImuCalibration",
    "OrientationFilter",
    "Problem",
    "estimate_recording",
]
