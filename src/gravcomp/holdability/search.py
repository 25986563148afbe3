"""The answer for one direction of gravity: how far the path goes within the limits, and what ends it."""

import numpy as np

from gravcomp.full_model.law_range import beyond_range
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.holdability.answer import Binding, DirectionAnswer
from gravcomp.holdability.limits import unlimited_rates
from gravcomp.holdability.linear import LinearHolding
from gravcomp.holdability.options import HoldOptions
from gravcomp.holdability.path import HoldPath, PathPoint
from gravcomp.holdability.symmetry import symmetries_of
from gravcomp.inverse.rest_target import rest_target
from gravcomp.inverse.target import Target
from gravcomp.standard_gravity import STANDARD_GRAVITY

# A path that ends with an eigenvalue that reaches zero within this many of its least steps ends by buckling.
_NEAR = 4.0
_LITTLE = 0.1
# The last equilibrium of a path is compressed to this part of the strain at which the material softens, at least.
_NEARLY = 0.75


class HoldSearch:
    """Finds answers for one robot and target. The answer for a direction does not depend on those before it."""

    def __init__(self, model: RobotModel, target: Target | None = None, options: HoldOptions | None = None):
        """target: default the tip at rest; options: default `HoldOptions()`. Raises ValueError for a robot without cables."""
        if not model.robot.cables:
            raise ValueError(f"robot '{model.robot.name}' has no cables, so nothing holds it")
        self.model, self.robot = model, model.robot
        self.options = options or HoldOptions()
        self.target = target or rest_target(model.robot)
        self.path = HoldPath(model, self.target, self.options)
        self.limits = unlimited_rates(self.robot.limits)
        self.wide = unlimited_rates(self.robot.limits, self.options.beyond)
        self.linear = LinearHolding(model, self.path.linear_answer, self.wide)
        self.tolerance = self.options.tolerance * model.length
        self.symmetries = symmetries_of(model, self.target)

    def linear_demand(self, direction: np.ndarray) -> float:
        """Return the demand of the linear estimate for a direction (3,); beyond the wider limits where these do not hold it."""
        tension, lateral = self.linear.tension(STANDARD_GRAVITY * direction)
        demand = float(tension.max()) / self.limits.tension_max
        return demand if lateral <= self.tolerance else self.options.beyond + lateral / self.tolerance

    def answer(self, direction: np.ndarray) -> DirectionAnswer:
        """Return the answer for a direction (3,) of gravity, a unit vector."""
        gravity = STANDARD_GRAVITY * direction
        first, _ = self.linear.tension(gravity)
        points = self.path.follow(gravity, self.wide, first, may_leave=True)
        if not points or points[0].lateral > self.tolerance:
            return self._unreached(direction, points)
        last = points[-1]
        complete, left = last.share >= 1.0, self.path.has_left(last)
        share, binding, cable = self._first_violation(points)
        cause = "" if complete else beyond_range(self.model, self.path.displacements, _NEARLY)
        possible = complete and last.lateral <= self.tolerance
        held, lateral = share >= 1.0 and complete, last.lateral if complete else None
        if binding in (Binding.TENSION, Binding.DISPLACEMENT):
            # Within the limits other cables may take over what the most loaded one may not.
            points = self.path.follow(gravity, self.limits, np.minimum(first, self.limits.tension_max))
            lateral = points[-1].lateral if points and points[-1].share >= 1.0 else None
            if lateral is not None and lateral <= self.tolerance:
                held, share, binding, cable, last = True, 1.0, Binding.NOTHING, None, points[-1]
        return DirectionAnswer(
            direction=direction,
            held=held,
            share=share,
            binding=binding,
            cable=cable,
            demand=max(self._ratios(last)) if possible else None,
            tension=float(last.tension.max()) if possible else None,
            displacement=float(last.displacement[np.argmax(np.abs(last.displacement))]) if possible else None,
            lateral=lateral,
            eigenvalue=last.eigenvalues.free,
            eigenvalue_held=last.eigenvalues.held,
            end=None if complete or left else last.share,
            cause=cause if binding == Binding.EQUILIBRIUM else "",
        )

    def _ratios(self, point: PathPoint) -> tuple[float, float]:
        """Return what a point needs over what is allowed: of the tension, and of the displacement."""
        limits = self.limits
        stroke = _over(point.displacement.max(), limits.displacement_max)
        # A slack cable has to be paid out along its path, too.
        return float(point.tension.max()) / limits.tension_max, max(
            stroke, _over(point.displacement.min(), limits.displacement_min)
        )

    def _first_violation(self, points: list[PathPoint]) -> tuple[float, Binding, str | None]:
        """Return the share of gravity up to which the tip is held on a path, what ends it, and the cable."""
        names = self.robot.cable_names
        before = points[0]
        for point in points:
            tension, stroke = self._ratios(point)
            off = point.lateral / self.tolerance
            if max(tension, stroke, off) > 1.0:
                tension_before, stroke_before = self._ratios(before)
                off_before = before.lateral / self.tolerance
                found = [
                    (_crossing(tension_before, tension), Binding.TENSION, names[int(np.argmax(point.tension))]),
                    (_crossing(stroke_before, stroke), Binding.DISPLACEMENT, names[int(np.argmax(np.abs(point.displacement)))]),
                    (_crossing(off_before, off), Binding.CABLES, None),
                ]
                part, binding, cable = min(found, key=lambda entry: entry[0])
                return before.share + part * (point.share - before.share), binding, cable
            before = point
        if before.share >= 1.0:
            return 1.0, Binding.NOTHING, None
        return before.share, Binding.BUCKLING if self._buckles(points) else Binding.EQUILIBRIUM, None

    def _buckles(self, points: list[PathPoint]) -> bool:
        """Return whether the smallest eigenvalue goes to zero where a path ends."""
        last = points[-1]
        if last.eigenvalues.free < _LITTLE or len(points) == 1:
            return last.eigenvalues.free < _LITTLE
        slope = (last.eigenvalues.free - points[-2].eigenvalues.free) / (last.share - points[-2].share)
        return last.eigenvalues.free + _NEAR * self.path.least_step * slope <= 0.0

    def _unreached(self, direction: np.ndarray, points: list[PathPoint]) -> DirectionAnswer:
        """Return the answer where the weightless robot does not reach the target, or no shape of it is found."""
        binding, lateral = (Binding.TARGET, points[0].lateral) if points else (Binding.EQUILIBRIUM, None)
        return DirectionAnswer(direction, False, 0.0, binding, None, None, None, None, lateral, 0.0, 0.0, 0.0)


def _over(value: float, limit: float) -> float:
    """Return value / limit for values on the limit's side, 0 else."""
    if limit == 0.0:
        return 0.0 if abs(value) < 1e-6 else np.inf
    return max(0.0, float(value / limit))


def _crossing(before: float, after: float) -> float:
    """Return the part of the way from `before` to `after` at which 1 is passed, infinity where it is not."""
    if after <= 1.0:
        return np.inf
    return 0.0 if before >= 1.0 else (1.0 - before) / (after - before)
