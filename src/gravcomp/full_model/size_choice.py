"""The size of the tetrahedra in a surface with which the tip is accurate enough.

The error of a mesh is estimated from one shape (`recovered_strain`). That of quadratic tetrahedra with one pressure each falls
with the square of their size, by which the next size is found. The size in the robot's file, if any, is the first and the
largest one. The choice is kept in the cache, by content.
"""

import dataclasses
import json
import logging
import math
from pathlib import Path

from gravcomp.cache import cache_path, content_key
from gravcomp.description import MeshBody, Robot
from gravcomp.full_model.mesh_choice import ACCURACY, described_for_mesh
from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.recovered_strain import MeshEstimate, estimated_error, too_long
from gravcomp.mesh.body import first_size
from gravcomp.mesh.mesh import MeshError
from gravcomp.whole_file import write_whole

_LOGGER = logging.getLogger(__name__)
_FORMAT = 2  # part of the key; to be raised when the choice changes
_USED, _TIMES = 0.8, 6
# From one size to the next: the estimate of a coarse mesh is not relied on further.
_LEAST, _MOST = 0.4, 0.85
# What a first size is multiplied by where it cannot be meshed, and a size where a step takes too long: the time of a step falls
# with the size to the power 7 (elements with its third, time with that number to the 7/3).
_SMALLER, _LARGER, _POWER = 0.7, 1.05, 1.0 / 7.0


def with_chosen_size(robot: Robot) -> Robot:
    """Return the robot, whose body is a surface, with a size of elements. Raises MeshError if it cannot be filled."""
    body = robot.body
    assert body is not None
    path = place_of_choice(robot)
    if path.exists():
        return _with(robot, body, json.loads(path.read_text(encoding="utf-8"))["element_size"])
    size = body.element_size or first_size(body)
    sizes: dict[float, MeshEstimate] = {}
    costs: dict[float, float] = {}  # how many times as long as it may a step takes, of sizes with which it takes too long
    for left in range(_TIMES, 0, -1):
        try:
            model = MeshedModel(_with(robot, body, size))
        except MeshError:
            if sizes:
                break
            if body.element_size or left == 1:
                raise
            size *= _SMALLER  # facets as large as these are too far from the surface
            continue
        if (cost := too_long(model)) > 1.0:
            same = cost in costs.values()  # the shape needs elements as small as these
            costs[size] = cost
            affordable = _LARGER * size * cost**_POWER
            if same or affordable >= min([body.element_size or math.inf, *(_MOST * known for known in sizes)]):
                break
            size = affordable
            continue
        _LOGGER.info("estimating the error of tetrahedra of up to %.3g mm", 1e3 * size)
        estimate = estimated_error(model)
        if estimate is None:
            break
        sizes[size] = estimate
        if estimate.error <= _USED * ACCURACY:
            break
        size *= min(_MOST, max(_LEAST, (0.9 * _USED * ACCURACY / estimate.error) ** 0.5))
        if any(size <= known for known in costs):
            break
    best = min(sizes or [*costs, size], key=lambda known: sizes[known].error if sizes else costs.get(known, math.inf))
    if best in costs and (estimate := estimated_error(MeshedModel(_with(robot, body, best)))) is not None:
        sizes[best] = estimate
    if not sizes or sizes[best].error > ACCURACY:
        released = " with the cables released" if sizes and sizes[best].released else ""
        _LOGGER.warning(
            "the tetrahedra chosen for '%s', of %.3g mm, leave an estimated error of %s; wanted: %g %% of the length",
            robot.name,
            1e3 * best,
            f"{100 * sizes[best].error:.2g} %{released}" if sizes else "a size that is not known",
            100 * ACCURACY,
        )
    write_whole(path, json.dumps({"element_size": best, "estimate": sizes.get(best)}))
    return _with(robot, body, best)


def chosen_estimate(robot: Robot) -> MeshEstimate | None:
    """Return the estimate of the error that the chosen size leaves; None where it is not known, or no size is chosen."""
    if robot.body is None or robot.body.placed().kind != "tri3":
        return None
    path = place_of_choice(robot)
    stored = json.loads(path.read_text(encoding="utf-8"))["estimate"] if path.exists() else None
    return MeshEstimate(*stored) if stored else None


def place_of_choice(robot: Robot) -> Path:
    """Return the file of the choice for a robot in the cache, which may not exist yet. Raises MeshError."""
    body = robot.body
    assert body is not None
    content = [*described_for_mesh(robot), body.element_size, body.elements_max]
    return cache_path("mesh", content_key("size", _FORMAT, *content), ".json")


def _with(robot: Robot, body: MeshBody, size: float) -> Robot:
    return dataclasses.replace(robot, body=dataclasses.replace(body, element_size=size))
