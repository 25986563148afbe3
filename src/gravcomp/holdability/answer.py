"""The answer to the question whether a robot can be held, as data and as sentences. SI units."""

import dataclasses
import enum

import numpy as np


class Binding(enum.StrEnum):
    """What ends the share of gravity up to which a tip is held."""

    NOTHING = "nothing"
    TENSION = "tension"
    """A cable would need more than the largest tension."""
    DISPLACEMENT = "displacement"
    """A winch would have to pull in or pay out farther than allowed."""
    CABLES = "cables"
    """No cables pull in the direction that is needed, whatever their tension."""
    BUCKLING = "buckling"
    """The tangent stiffness is no longer positive definite at constant tension."""
    EQUILIBRIUM = "equilibrium"
    """The path of equilibria ends because the material softens; or the search ends, and nothing is known beyond: see `known`."""
    TARGET = "target"
    """The weightless robot does not reach the target."""


@dataclasses.dataclass(frozen=True)
class DirectionAnswer:
    """The answer for one direction of gravity.

    direction (3,): unit vector in soft_base; held: whether the tip is held within the limits; share of gravity up to which it is
    held, at most 1; binding, and the cable where it is one; demand: what the most loaded cable needs over what its limits allow,
    None if no tension holds the tip; tension in N and displacement in m that are needed, largest of the cables, None likewise;
    lateral in m: error that remains at the whole gravity within the limits, None where no equilibrium was found; eigenvalue:
    the smallest at the end of the path, over that at rest, at constant tension, and eigenvalue_held with taut cables held; end:
    share of gravity at which the path of equilibria ends, None if it does not; cause: why it ends, as a sentence, where that is
    known.
    """

    direction: np.ndarray
    held: bool
    share: float
    binding: Binding
    cable: str | None
    demand: float | None
    tension: float | None
    displacement: float | None
    lateral: float | None
    eigenvalue: float
    eigenvalue_held: float
    end: float | None
    cause: str = ""

    @property
    def known(self) -> bool:
        """Whether the answer is known: a search that ends without a cause says nothing about what lies beyond."""
        return self.held or self.binding != Binding.EQUILIBRIUM or bool(self.cause)

    @property
    def severity(self) -> float:
        """Order of the directions: larger is worse. At most 1 where the tip is held within the limits, 2 where it is unknown."""
        if self.held:
            return min(1.0, self.demand or 0.0)
        return 2.0 - min(self.share, 1.0) if not self.known else 1.0 + 1.0 / max(self.share, 1e-3)


@dataclasses.dataclass(frozen=True)
class Needed:
    """What would hold a robot that its limits do not hold, in its worst direction of gravity.

    tension in N of every cable and displacement in m of every winch that would do; radius_factor: by which all cables have to
    be farther from the axis to be held within the limits, None where that was not found; radius_fits: whether they stay in the
    body; widest_factor: largest factor with which they do, and widest_tension in N that is needed there.
    """

    tension: float | None
    displacement: float | None
    radius_factor: float | None = None
    radius_fits: bool = False
    widest_factor: float | None = None
    widest_tension: float | None = None


@dataclasses.dataclass(frozen=True)
class Holdability:
    """Whether a robot's cables keep its tip laterally on a target.

    tolerance in m; directions, in the order of the sphere; worst: index of the worst direction; released: lateral error in m of
    the released robot in that direction, None where no equilibrium was found; buckling: factor of gravity at which a held robot
    buckles first, None: not up to `overload`, which is 1 where no larger load was looked at; buckling_direction (3,); needed:
    None where the robot is held; tension_max in N and displacement_min and displacement_max in m: the limits; radius (m,): of the
    cables in m, NaN for those with via points.
    """

    model: str
    tolerance: float
    directions: tuple[DirectionAnswer, ...]
    worst: int
    released: float | None
    buckling: float | None
    buckling_direction: np.ndarray | None
    overload: float
    needed: Needed | None
    tension_max: float
    displacement_min: float
    displacement_max: float

    @property
    def held(self) -> bool:
        """Whether the tip is held in every direction."""
        return all(answer.held for answer in self.directions)

    @property
    def refuted(self) -> bool:
        """Whether there is a direction in which the tip is known not to be held."""
        return any(answer.known and not answer.held for answer in self.directions)

    @property
    def unknown(self) -> tuple[DirectionAnswer, ...]:
        """The directions for which the search ended without an answer."""
        return tuple(answer for answer in self.directions if not answer.known)

    @property
    def ended(self) -> bool:
        """Whether a path of equilibria ends before the whole gravity acts."""
        return any(answer.end is not None and answer.known for answer in self.directions)

    @property
    def held_share(self) -> float:
        """Share of the directions in which the tip is held: about an area, because rings near the poles have fewer directions."""
        return sum(answer.held for answer in self.directions) / len(self.directions)
