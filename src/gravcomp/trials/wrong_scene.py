"""A robot whose target is behind a wall that is not where the model's scene has it."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.graph.parameters.virtual_tracker import VirtualTrackerParameters
from gravcomp.inverse import Target, straight_target
from gravcomp.scene import PlaneWall, SceneSection
from gravcomp.scene.scene import Scene
from gravcomp.virtual.motion import StaticMotion, base_orientation

_GAP, _BEHIND = 0.06, 0.05  # of the robot's length: from the straight robot to the modelled wall, and from there to the target
# s: straight, then at the wall; the part of it in which the robot should be at rest
_STRAIGHT, _HELD, _LAST = 4.0, 10.0, 2.0


@dataclass(frozen=True)
class WrongSceneCase:
    """By how much the true wall is nearer than the modelled one, m; the tracker, None: there is none; bound of the force, N."""

    nearer: float
    tracker: VirtualTrackerParameters | None = None
    largest_force: float | None = None


@dataclass(frozen=True)
class WrongSceneOutcome:
    """True force of the wall in N, largest and at the end; ripple in m: of the true tip at the end; what the loop said."""

    peak: float
    force: float
    ripple: float
    sentences: tuple[str, ...]


def run_wrong_scene(job: tuple[Setup, WrongSceneCase]) -> WrongSceneOutcome:
    """Hold a horizontal robot straight, then lead its tip to a target below a plane."""
    setup, case = job
    length, radius = setup.robot.length, 0.5 * setup.robot.segments[-1].outer_diameter
    below = radius + _GAP * length

    def wall(depth: float) -> Scene:
        plane = PlaneWall(name="table", normal=(1.0, 0.0, 0.0), point=(-depth, 0.0, 0.0))
        return Scene(SceneSection(planes=(plane,)))

    inverse = dataclasses.replace(setup.controller.inverse, max_contact_force=case.largest_force)
    setup = dataclasses.replace(
        setup,
        scene=wall(below - case.nearer),
        modelled_scene=wall(below),
        controller=dataclasses.replace(setup.controller, inverse=inverse),
    )
    loop = ClosedLoop(setup, StaticMotion(base_orientation(0.0)), tracker=case.tracker)
    loop.hold(straight_target(length))
    loop.run(_STRAIGHT)
    loop.forget()
    loop.hold(Target(np.array([-(_GAP + _BEHIND) * length, 0.0, 0.98 * length])))
    begin, sentences = loop.time, []
    while loop.time < begin + _HELD:
        loop.run(0.5)
        said = loop.observer.status(loop.time).sentence
        if said and said not in sentences:
            sentences.append(said)
    trace = loop.trace.between(begin + _HELD - _LAST)
    return WrongSceneOutcome(
        peak=float(loop.trace.wall_force.max()),
        force=float(trace.wall_force.mean()),
        ripple=float(np.linalg.norm(trace.tip_position - trace.tip_position.mean(axis=0), axis=1).max()),
        sentences=tuple(sentences),
    )
