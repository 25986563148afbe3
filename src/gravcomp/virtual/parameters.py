"""Parameters of the section `virtual_robot:` of a robot file: the true values, which the controller does not have.

Segments, cables and motors come from `robot:` and `hardware:`. What is not given here (None) is drawn relative to them by the
seed, see `draw.py`.
"""

import dataclasses

from gravcomp.config import parameter
from gravcomp.thermal.plant import ThermalPlantOptions
from gravcomp.virtual.imu_grades import IMU_GRADES


@dataclasses.dataclass(frozen=True)
class Body:
    """Material and element length of the rod."""

    youngs_modulus: float | None = parameter(
        None, edge="MPa", minimum=1e-3, maximum=1e6, description="long-term, of every segment; caps keep theirs"
    )
    modulus_ratio: tuple[float, ...] | None = parameter(
        None, minimum=0.01, maximum=100.0,
        description="long-term modulus over the described one, for all segments or for each; instead of youngs_modulus_mpa",
    )  # fmt: skip
    poissons_ratio: float | None = parameter(
        None, minimum=0.0, maximum=0.4999, description="Poisson's ratio of every segment; the described one when not given"
    )
    density: float | None = parameter(
        None, unit="kg/m^3", minimum=1.0, maximum=30000.0, description="density of every segment; caps keep theirs"
    )
    creep_ratio: tuple[float, ...] | None = parameter(
        None, minimum=0.0, maximum=10.0, description="stiffness of each Maxwell branch over the long-term stiffness"
    )
    creep_time: tuple[float, ...] | None = parameter(
        None, unit="s", minimum=1e-3, maximum=1e5, description="relaxation time of each Maxwell branch"
    )
    damping_time: float | None = parameter(
        None, edge="ms", minimum=0.0, maximum=1000.0, description="Kelvin-Voigt damping over stiffness"
    )
    slip_ratio: float | None = parameter(
        None, minimum=0.0, maximum=1.0, description="bending stiffness of the frictional branch over the long-term one"
    )
    slip_curvature: float | None = parameter(
        None, unit="1/m", minimum=0.01, maximum=1000.0, description="curvature at which that branch slips"
    )
    element_length: float | None = parameter(
        None, edge="mm", minimum=0.05, maximum=1000.0, description="longest rod element; a twentieth of the robot when not given"
    )

    def __post_init__(self) -> None:
        if (self.creep_ratio is None) != (self.creep_time is None):
            raise ValueError("creep_ratio and creep_time belong together; give both or neither")
        if self.creep_ratio is not None and self.creep_time is not None and len(self.creep_ratio) != len(self.creep_time):
            raise ValueError(
                f"creep_ratio has {len(self.creep_ratio)} entries and creep_time {len(self.creep_time)}; equally many are needed"
            )
        if self.youngs_modulus is not None and self.modulus_ratio is not None:
            raise ValueError("youngs_modulus_mpa and modulus_ratio are both given; give one of them")


@dataclasses.dataclass(frozen=True)
class Tendons:
    """True values of the cables; each holds for every cable."""

    axial_stiffness: float | None = parameter(
        None, unit="N", minimum=1.0, maximum=1e9, description="E A; nylon of 0.7 mm has 960: 2.5 GPa x 0.385 mm^2"
    )
    free_length: float | None = parameter(None, edge="mm", minimum=0.0, maximum=20000.0, description="between capstan and robot")
    radius_offset: float | None = parameter(
        None, edge="mm", minimum=-5.0, maximum=5.0, description="true pitch radius minus the one in robot.cables"
    )
    angle_offset: float | None = parameter(
        None, edge="deg", minimum=-180.0, maximum=180.0, description="true angle minus the one in robot.cables"
    )
    friction: float | None = parameter(None, minimum=0.0, maximum=2.0, description="capstan friction coefficient")
    guide_angle: float | None = parameter(
        None, edge="deg", minimum=0.0, maximum=3600.0, description="angle by which the cable is bent between capstan and robot"
    )
    presliding: float | None = parameter(
        None, edge="mm", minimum=0.0001, maximum=10.0, description="distance over which friction reverses"
    )
    slack: float = parameter(
        0.0, edge="mm", minimum=-50.0, maximum=50.0, description="length at the start beyond the unloaded robot's"
    )
    slack_spread: float = parameter(
        0.0, edge="mm", minimum=0.0, maximum=50.0, description="standard deviation of slack from cable to cable"
    )


@dataclasses.dataclass(frozen=True)
class Motors:
    """True values of the C610 speed controllers and M2006 motors."""

    feedback_rate: int = parameter(500, unit="Hz", choices=(1000, 500, 250, 125), description="as set in the C610")
    torque_constant: float | None = parameter(None, unit="N m/A", minimum=1e-3, maximum=10.0, description="at the gear's output")
    capstan_radius: float | None = parameter(
        None, edge="mm", minimum=0.1, maximum=100.0, description="to the middle of the cable"
    )
    rotor_inertia: float = parameter(8e-7, unit="kg m^2", minimum=1e-9, maximum=1.0, description="of rotor and first gear stage")
    friction_torque: float = parameter(4e-4, unit="N m", minimum=0.0, maximum=1.0, description="Coulomb friction at the rotor")
    load_friction: float | None = parameter(
        None, minimum=0.0, maximum=1.0, description="friction at the rotor over the load torque there"
    )
    viscous_friction: float = parameter(1.3e-6, unit="N m s", minimum=0.0, maximum=1.0, description="at the rotor")
    no_load_speed: float = parameter(
        2000.0, unit="rad/s", minimum=1.0, maximum=1e5, description="rotor speed at which the current is 0"
    )
    backlash: float | None = parameter(None, edge="deg", minimum=0.0, maximum=90.0, description="of the gear, at its output")
    capstan_drag: float = parameter(
        1e-3, unit="N m", minimum=0.0, maximum=1.0, description="friction that holds the capstan inside the backlash"
    )
    current_lag: float = parameter(1.0, edge="ms", minimum=0.01, maximum=100.0, description="time constant of the current loop")
    current_noise: float = parameter(
        0.004, unit="A", minimum=0.0, maximum=1.0, description="standard deviation of the current in the feedback"
    )


@dataclasses.dataclass(frozen=True)
class Board:
    """IMU and heater. Biases are drawn with the standard deviations given here; what is not given is that of the grade."""

    grade: str = parameter("bmi088", choices=tuple(IMU_GRADES), description="IMU whose data sheet gives what is not given here")
    accelerometer_range: int = parameter(1, minimum=0, maximum=3, description="range code: 0 to 3 = 3, 6, 12, 24 g")
    gyroscope_range: int = parameter(0, minimum=0, maximum=4, description="range code: 0 to 4 = 2000, 1000, 500, 250, 125 deg/s")
    accelerometer_noise: float = parameter(None, unit="g/sqrt(Hz)", minimum=0.0, maximum=1.0, description="noise density")
    gyroscope_noise: float = parameter(
        None, edge="deg/s", minimum=0.0, maximum=100.0, description="noise density, (deg/s)/sqrt(Hz)"
    )
    bandwidth: float = parameter(40.0, unit="Hz", minimum=1.0, maximum=1000.0, description="of the chip's low-pass")
    accelerometer_bias: float = parameter(None, unit="g", minimum=0.0, maximum=1.0, description="at 25 degC")
    accelerometer_scale: float = parameter(None, minimum=0.0, maximum=0.5, description="relative error of scale")
    accelerometer_drift: float = parameter(
        None, unit="g/K", minimum=0.0, maximum=0.1, description="bias over temperature, +- by axis"
    )
    gyroscope_bias: float = parameter(None, edge="deg/s", minimum=0.0, maximum=100.0, description="at 25 degC")
    gyroscope_drift: float = parameter(
        None, edge="deg/s", minimum=0.0, maximum=10.0, description="bias over temperature, deg/s per K, +- by axis"
    )
    gyroscope_walk: float = parameter(
        None, edge="deg/s", minimum=0.0, maximum=10.0, description="bias random walk, (deg/s)/sqrt(s)"
    )
    mount_error: float = parameter(
        0.0, edge="deg", minimum=0.0, maximum=45.0, description="misalignment against robot.imu_mount, drawn with the seed"
    )
    clock_error: float = parameter(30e-6, minimum=-0.01, maximum=0.01, description="of the board's oscillator, relative")
    thermal: ThermalPlantOptions | None = parameter(
        None, description="heater and surroundings; with a drawn temperature of the surroundings when not given"
    )

    def __post_init__(self) -> None:
        for name, value in IMU_GRADES[self.grade].items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)


@dataclasses.dataclass(frozen=True)
class VirtualRobotParameters:
    """What is given of the virtual robot."""

    body: Body = parameter(default_factory=Body, description="material of the rod")
    tendons: Tendons = parameter(default_factory=Tendons, description="cables")
    motors: Motors = parameter(default_factory=Motors, description="motors, gears and capstans")
    board: Board = parameter(default_factory=Board, description="IMU board")
    seed: int = parameter(
        1, minimum=0, maximum=2**31 - 1, description="of all that is drawn: the same seed gives the same robot and the same run"
    )
    description: str = parameter(
        "", description="robot file whose virtual robot this is, in place of one drawn around this file; a calibrated file has it"
    )
