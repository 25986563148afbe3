"""Parameters of the node imu_estimator."""

from dataclasses import dataclass, field

from gravcomp.config import parameter
from gravcomp.orientation.estimator import EstimatorOptions
from gravcomp.orientation.imu_calibration import ImuCalibration
from gravcomp.orientation.options import FilterOptions
from gravcomp.orientation.prediction import PredictionOptions
from gravcomp.thermal.heater import HeaterOptions

RELIABILITIES = ("auto", "best_effort", "reliable")


@dataclass(frozen=True)
class ImuEstimatorParameters:
    """Parameters of the node; the pose of the IMU is in the robot file under robot.imu_mount."""

    imu_frame: str = parameter("imu_link", description="frame of imu/data", read_only=True)
    base_frame: str = parameter("soft_base", description="frame of gravity", read_only=True)
    reliability: str = parameter(
        "auto",
        choices=RELIABILITIES,
        read_only=True,
        description="reliability of the subscription to imu/data_raw; auto: as offered, so that no sample of a replay is lost",
    )
    stale_time: float = parameter(
        0.5, unit="s", minimum=0.05, maximum=10, description="without a sample for this time the status is NO_DATA"
    )
    arm_acceleration: bool = parameter(
        False,
        read_only=True,
        description="subtract arm/acceleration of arm_gravity, so that a fast arm does not tilt the estimate",
    )
    bias_model_file: str = parameter(
        "", read_only=True, description="file of the bias over temperature; empty: neither used nor learned", unit="path"
    )
    filter: FilterOptions = field(default_factory=FilterOptions)
    calibration: ImuCalibration = field(default_factory=ImuCalibration)
    prediction: PredictionOptions = field(default_factory=PredictionOptions)
    heater: HeaterOptions = field(default_factory=HeaterOptions)

    @property
    def estimator(self) -> EstimatorOptions:
        """Options of the orientation estimate."""
        return EstimatorOptions(self.filter, self.calibration, self.prediction)
