"""Parameters of the correction by a measured tip: what the tracker is like, and how wrong the model may be."""

from dataclasses import dataclass

from gravcomp.config import parameter


@dataclass(frozen=True)
class TipObserverOptions:
    """Options of the observer. Those about the model are shares, so they suit any robot."""

    use: bool = parameter(True, description="correct the model's error with measured/tip; without measurements nothing changes")
    std: float = parameter(
        0.5, edge="mm", minimum=0.001, maximum=100.0, description="standard deviation of a measured position, along each axis"
    )
    stamp: str = parameter(
        "header",
        choices=("header", "arrival"),
        description="time of a measurement: that of its header, or that of its arrival where the tracker has another clock",
    )
    delay: float = parameter(
        0.0, edge="ms", minimum=0.0, maximum=2000.0, description="from the measurement to the time that `stamp` names"
    )
    longest_delay: float = parameter(
        1000.0, edge="ms", minimum=10.0, maximum=5000.0, description="measurements that are later are refused"
    )
    stale_after: float = parameter(
        2.0,
        unit="s",
        minimum=0.1,
        maximum=3600.0,
        description="without an accepted measurement for this time the status says so; the last correction is kept",
    )
    frame: str = parameter("", description="frame of the tracker's poses, fixed to soft_base; empty: soft_base itself")
    position: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), edge="mm", minimum=-1e5, maximum=1e5, description="origin of this frame in soft_base"
    )
    rpy: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), edge="deg", minimum=-360.0, maximum=360.0, description="orientation of this frame in soft_base"
    )
    marker: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), edge="mm", minimum=-1e4, maximum=1e4, description="measured point in soft_tip, 0 0 0: the tip itself"
    )
    authority: float = parameter(
        0.1, minimum=0.001, maximum=0.5, description="largest correction, share of the robot's length; what is farther is refused"
    )
    model_error: float = parameter(
        0.15, minimum=0.001, maximum=1.0, description="expected relative error of the model's weight over stiffness"
    )
    drift: float = parameter(
        0.0015, minimum=1e-5, maximum=0.1, description="growth of the model's error at rest in 1 s, share of the released sag"
    )
    forget: float = parameter(
        600.0,
        unit="s",
        minimum=1.0,
        maximum=1e6,
        description="time in which the model's relative error becomes as uncertain as at the start: as the material ages",
    )
    response: float = parameter(
        100.0, edge="ms", minimum=0.0, maximum=2000.0, description="by how much the robot may follow the model late"
    )

    def __post_init__(self) -> None:
        for name in ("position", "rpy", "marker"):
            if len(getattr(self, name)) != 3:
                raise ValueError(f"{name} has {len(getattr(self, name))} numbers; 3 are needed")
