"""Motors, and the cables that each of them moves.

A motor winds the line of its `cable`. It may move others as well: the antagonist on the far side of the same capstan (`pair`),
or any cables over capstans of other radii, gears and pulleys (`also`). A cable that two motors move together (a differential) is
named by both of them. With the displacement u (k,) at the drive's capstans, the cables' displacements are (see `transmission`)

    delta = T u + s,    T_ij = ratio of cable i on motor j,    s: preload of the pairs.
"""

import dataclasses

from gravcomp.config import parameter

MOTOR_IDS = range(1, 9)
"""CAN ids that a C610 can have."""


@dataclasses.dataclass(frozen=True)
class CableMotor:
    """What every motor has, whatever drives it: its cables."""

    cable: str = parameter(description="name of the cable in robot.cables")
    _: dataclasses.KW_ONLY
    direction: int = parameter(1, choices=(1, -1), description="1: positive rotation of the motor pulls the cable in")
    offset: float = parameter(
        0.0, edge="mm", minimum=-20, maximum=20, description="calibrated displacement of the cable at the motor's zero position"
    )
    ratio: float = parameter(
        1.0, minimum=0.01, maximum=100.0, description="displacement of the cable over that at the drive's capstan"
    )
    pair: str | None = parameter(
        None, description="antagonistic cable on the same capstan: it is paid out as far as `cable` is pulled in"
    )
    also: dict[str, float] = parameter(
        default_factory=dict,
        minimum=-100.0,
        maximum=100.0,
        description="further cables of this motor, each with its ratio; negative: paid out while `cable` is pulled in",
    )
    preload: float = parameter(
        0.0, edge="mm", minimum=0.0, maximum=50.0, description="how far both cables of a pair are pulled in at the zero position"
    )
    differential: bool = parameter(
        False, description="other motors move these cables as well, and the displacements add up; set it at each of them"
    )

    def __post_init__(self) -> None:
        if self.pair is not None and self.also:
            raise ValueError(f"{self.label} has pair and also; write the antagonist in `also` with a negative ratio")
        if self.preload and self.pair is None:
            raise ValueError(f"{self.label} has preload_mm without pair; only an antagonistic pair can be preloaded")
        if self.cable in self.ratios_of_others:
            raise ValueError(f"{self.label} names its cable '{self.cable}' twice")
        for cable, ratio in self.also.items():
            if ratio == 0.0:
                raise ValueError(f"{self.label}.also: the ratio of '{cable}' is 0; leave the cable out, or give its ratio")

    @property
    def ratios_of_others(self) -> dict[str, float]:
        """Ratios of the cables other than `cable`."""
        return dict(self.also) if self.pair is None else {self.pair: -self.ratio}

    @property
    def ratios(self) -> dict[str, float]:
        """Displacement of each cable over that at the drive's capstan."""
        return {self.cable: self.ratio, **self.ratios_of_others}

    @property
    def label(self) -> str:
        """Name of the motor in messages."""
        return f"motor ({', '.join(self.ratios)})"


@dataclasses.dataclass(frozen=True)
class Motor(CableMotor):
    """A C610 on a CAN bus."""

    can_id: int = parameter(minimum=1, maximum=8, description="CAN id that is set on the C610, unique on its bus")
    _: dataclasses.KW_ONLY
    bus: str | None = parameter(None, description="name of the motor's bus in hardware.buses; needed with more than one")

    @property
    def label(self) -> str:
        """Name of the motor in messages: CAN id, bus and cables."""
        where = f" on bus {self.bus}" if self.bus else ""
        return f"motor {self.can_id}{where} ({', '.join(self.ratios)})"
