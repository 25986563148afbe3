"""A person's hand that steers by a picture.

Aiming is the crossover model: near the crossover frequency hand and controlled element together are an integrator with a delay,

    Y(s) = w_c exp(-tau s) / s

(D. T. McRuer, H. R. Jex, "A review of quasi-linear pilot models", IEEE Trans. Human Factors in Electronics 8, 1967). Here the
controlled element is a gain, the angle of the tip's bend, so that the hand itself integrates. The remnant, what is not linear in
the picture, is noise on the displayed angles, white, with a density of 0.01 pi of their mean square (W. H. Levison, S. Baron,
D. L. Kleinman, "A model for human controller remnant", IEEE Trans. Man-Machine Systems 10, 1969). The tremor of the hand that
holds the handle is that of `virtual.motion.TremorMotion`, without its drift: a person who sees the picture corrects that.

Pushing is by hand as well: forward while what is aimed at is near the middle of the picture, and the slower, the farther it is
off. The hand does not feel the wall, the patient does: at pain, a delay later, the hand pulls back until the pain has gone.
"""

import collections
from dataclasses import dataclass

import numpy as np

from gravcomp.config import parameter
from gravcomp.operator.picture import Picture

_FORGETTING = 2.0  # s, over which the mean square of the displayed angles is taken
_REMNANT = 0.01 * np.pi  # density of the remnant over the mean square


@dataclass(frozen=True)
class Person:
    """A person who steers. The force at which it hurts is a pressure times the area of the robot's face.

    30 mmHg is about the pressure at which the distension of a colon hurts (barostat studies: 20 to 50 mmHg).
    """

    delay: float = parameter(0.25, unit="s", minimum=0.0, maximum=2.0, description="from the picture to the hand")
    crossover: float = parameter(0.8, unit="rad/s", minimum=0.1, maximum=6.0, description="crossover frequency when aiming")
    speed: float = parameter(10.0, edge="mm/s", minimum=0.01, maximum=500.0, description="along the axis, when aimed well")
    pull_speed: float = parameter(10.0, edge="mm/s", minimum=0.01, maximum=500.0, description="back, at pain")
    aim: float = parameter(35.0, edge="deg", minimum=1.0, maximum=90.0, description="angle off the middle at which pushing ends")
    pain: float = parameter(4e-3, edge="MPa", minimum=1e-6, maximum=1.0, description="pressure of the wall that hurts")
    relief: float = parameter(0.5, minimum=0.0, maximum=1.0, description="share of that pressure at which the pain has gone")


@dataclass(frozen=True)
class Hand:
    """What the hand does: rate (2,) rad/s at which it bends the tip, along x and y of its section; speed (m/s) along the axis."""

    rate: np.ndarray
    speed: float
    hurt: bool


class Steering:
    """A person at work. The same seed gives the same hand."""

    def __init__(self, person: Person, period: float, area: float, seed: int):
        """Begin with a hand at rest. period (s): between pictures; area (m^2): of the robot's face."""
        self._person, self._period = person, period
        self._pain_force = person.pain * area
        self._random = np.random.default_rng([seed, 7])
        late = round(person.delay / period)
        self._under_way: collections.deque[tuple[np.ndarray | None, float]] = collections.deque([(None, 0.0)] * late)
        self._mean_square = 0.0
        self._hurt = False

    @property
    def pain_force(self) -> float:
        """Force of the wall (N) that hurts."""
        return self._pain_force

    def act(self, picture: Picture, wall_force: float) -> Hand:
        """Return what the hand does now; wall_force (N): what the patient feels now."""
        person = self._person
        shown = picture.target if picture.target is not None else picture.ahead
        self._under_way.append((shown, wall_force))
        error, force = self._under_way.popleft()
        self._hurt = force > (person.relief if self._hurt else 1.0) * self._pain_force
        if error is None:
            return Hand(np.zeros(2), -person.pull_speed if self._hurt else 0.0, self._hurt)
        share = min(1.0, self._period / _FORGETTING)
        self._mean_square += share * (float(error @ error) / 2.0 - self._mean_square)
        remnant = np.sqrt(_REMNANT * self._mean_square / self._period) * self._random.standard_normal(2)
        off = float(np.linalg.norm(error))
        speed = -person.pull_speed if self._hurt else person.speed * max(0.0, 1.0 - off / person.aim)
        return Hand(person.crossover * (error + remnant), speed, self._hurt)
