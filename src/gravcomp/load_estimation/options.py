"""Parameters of the load's estimation."""

import dataclasses

from gravcomp.config import parameter

KINDS = ("none", "force", "payload")


@dataclasses.dataclass(frozen=True)
class LoadEstimationOptions:
    """What is looked for, and how much is known of the sensors and of the model."""

    kind: str = parameter(
        "none", choices=KINDS,
        description="unknown load at the tip: a force in any direction, or a payload, whose force is its mass times gravity",
    )  # fmt: skip
    compensate: bool = parameter(True, description="let the model carry the payload that is found, so that the cables hold it")
    compensate_force: bool = parameter(
        False,
        description="the same for a force, which must not depend on where the tip is: at a wall the cables would press harder",
    )
    tip_std: float = parameter(
        0.5, edge="mm", minimum=0.001, maximum=100.0, description="standard deviation of a measured tip along each axis"
    )
    tension_noise: float = parameter(
        0.01, minimum=0.0, maximum=1.0, description="standard deviation of a tension sensor, share of the tension"
    )
    tension_floor: float = parameter(
        0.001, minimum=1e-6, maximum=1.0, description="least standard deviation of a tension sensor, share of limits.tension_max"
    )
    tension_offset: float = parameter(
        0.01,
        minimum=0.0,
        maximum=1.0,
        description="zero error of a tension sensor before ~/zero_load, share of limits.tension_max",
    )
    cable_friction: float = parameter(
        0.03, minimum=0.0, maximum=1.0, description="part of a tension that friction may keep from the sensor, standard deviation"
    )
    friction_time: float = parameter(
        1.0, unit="s", minimum=0.01, maximum=1e4, description="time in which the friction of a held cable may turn round"
    )
    displacement_error: float = parameter(
        0.005, minimum=1e-6, maximum=1.0,
        description="expected error of a cable's displacement (backlash, stretch), share of limits.displacement_max",
    )  # fmt: skip
    stiffness_error: float = parameter(
        0.15, minimum=1e-4, maximum=1.0, description="expected relative error of the model's stiffness"
    )
    weight_error: float = parameter(0.03, minimum=1e-4, maximum=1.0, description="expected relative error of the model's weight")
    drift: float = parameter(
        0.0015, minimum=1e-5, maximum=0.1, description="growth of the model's tip error in 1 s, share of the released sag"
    )
    change_time: float = parameter(
        1000.0,
        unit="s",
        minimum=0.01,
        maximum=1e5,
        description="time in which a force may change unnoticed by as much as the cables can hold; faster changes show in the"
        " sensors, and the estimate begins again",
    )
    payload_time: float = parameter(
        60.0,
        unit="s",
        minimum=0.01,
        maximum=1e5,
        description="time in which what was measured of a payload loses its weight; a payload that changes by more than friction"
        " hides shows in the sensors, and the estimate begins again",
    )
    force_time: float = parameter(
        20.0,
        unit="s",
        minimum=0.01,
        maximum=1e5,
        description="time over which the force that bends a robot far is averaged, as long as the tips that are measured agree",
    )
    zero_time: float = parameter(
        3.0,
        unit="s",
        minimum=0.1,
        maximum=600.0,
        description="duration of ~/zero_load, in which the robot carries no load; for friction_time, at most the half of it, it"
        " comes to rest",
    )
    response: float = parameter(
        300.0, edge="ms", minimum=0.0, maximum=60000.0, description="time constant with which the model takes a new estimate"
    )
    lag: float = parameter(
        100.0, edge="ms", minimum=0.0, maximum=2000.0, description="by how much the robot may follow the model late"
    )
    stale_after: float = parameter(
        2.0, unit="s", minimum=0.1, maximum=3600.0, description="without a measurement for this time the last estimate is kept"
    )
