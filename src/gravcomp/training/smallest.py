"""The smallest part of a reduction that serves nearly as many trained shapes as the whole.

A step takes time in proportion to r^2 k for r modes and k strains. How many of them a robot needs is known only when both are
there: a slender robot is served as exactly with half of the principal strains, a very soft one needs nearly all. A shape is
served where the reduced tip is near enough to that of the full model. The cheapest part is taken that serves as many of the
shapes as the whole, but for a few: some are at the end of the equilibria, where the least difference decides. Where that holds
for most of them, they do not show what the fast motion of such a robot needs, and the whole is kept.
"""

import math
from collections.abc import Callable

from gravcomp.full_model.robot_model import RobotModel
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.reduction.store import Reduction
from gravcomp.training.samples import Sample
from gravcomp.training.tip_errors import tip_errors
from gravcomp.training.trained_shapes import evenly

_SHAPES = 120
_STEP = 4  # modes, and strains: compiled sums take four terms at a time
_MOST = 0.95  # of the shapes that the whole serves
_SHOWING = 0.5  # of all shapes: where the whole serves fewer, it is kept
_AT_ONCE = 10  # shapes; a part that cannot serve enough of them any more is left


def smallest(
    model: RobotModel,
    whole: Reduction,
    samples: list[Sample],
    modes: int,
    near: float,
    progress: Callable[[float], None] = lambda share: None,
) -> Reduction:
    """Return the cheapest part of the reduction that serves enough of the trained samples.

    modes: the fewest allowed; near: part of the length up to which a tip is near enough; progress: called with the fraction that
    is done.
    """
    reduced = whole.reduced_model(model)
    shown = [samples[number] for number in evenly(len(samples), _SHAPES)]

    def served(part: ReducedModel, least: int) -> int:
        """Return how many shapes a part serves; fewer than `least`: at most so many."""
        count, left = 0, len(shown)
        for start in range(0, len(shown), _AT_ONCE):
            if count + left < least:
                break
            some = shown[start : start + _AT_ONCE]
            count += int((tip_errors(model, part, some) <= near * model.length).sum())
            left -= len(some)
        return count

    r = reduced.size
    most = reduced.elasticity.linear.shape[1] - r
    parts = [(m, e) for m in range(min(modes, r), r + 1, _STEP) for e in range(_STEP, most + 1, _STEP)]
    parts.sort(key=lambda part: part[0] ** 2 * sum(part))
    by_whole = served(reduced, 0)
    enough = math.ceil(_MOST * by_whole)
    for number, part in enumerate(parts if by_whole >= _SHOWING * len(shown) else []):
        progress(number / len(parts))
        if served(reduced.of_first(*part), enough) >= enough:
            return whole.of_first(*part)
    return whole
