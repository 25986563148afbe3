"""Limits of the cables."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class Limits:
    """Limits of tension, displacement and their rates; the same for every cable."""

    tension_min: float = parameter(0.0, unit="N", minimum=0.0, maximum=1000.0, description="smallest tension")
    tension_max: float = parameter(5.0, unit="N", minimum=0.001, maximum=1000.0, description="largest tension")
    displacement_min: float = parameter(-30.0, edge="mm", minimum=-1000.0, maximum=0.0, description="farthest paid out")
    displacement_max: float = parameter(30.0, edge="mm", minimum=0.0, maximum=1000.0, description="farthest pulled in")
    tension_rate: float = parameter(20.0, unit="N/s", minimum=0.001, maximum=1e5, description="largest rate of tension")
    displacement_rate: float = parameter(40.0, edge="mm/s", minimum=0.001, maximum=1e4, description="largest speed of a cable")

    def __post_init__(self) -> None:
        if self.tension_min >= self.tension_max:
            raise ValueError(f"tension_min is {self.tension_min:g} N; allowed: below tension_max = {self.tension_max:g} N")
        if self.displacement_min >= self.displacement_max:
            raise ValueError("displacement_min_mm and displacement_max_mm are both 0; allowed: min below max")
