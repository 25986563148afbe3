"""Orientation of an IMU from its gyroscope and accelerometer, and gravity in the frame of the robot's base."""

from gravcomp.orientation.bias_model import BiasModelError, BiasTemperatureModel
from gravcomp.orientation.estimate import Estimate
from gravcomp.orientation.estimator import EstimatorOptions, GravityEstimate, GravityEstimator
from gravcomp.orientation.filter import OrientationFilter
from gravcomp.orientation.guard import Problem
from gravcomp.orientation.imu_calibration import ImuCalibration
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
