"""A loop with a tracker at a wall that is not where the model's scene has it."""

from collections.abc import Callable

from gravcomp.closed_loop.setup import Setup
from gravcomp.description import load_robot_file
from gravcomp.graph.parameters.virtual_tracker import VirtualTrackerParameters
from gravcomp.trials.wrong_scene import WrongSceneCase, run_wrong_scene

_TRACKER = VirtualTrackerParameters(rate=5.0, delay=0.1, std=0.5e-3)
_WRONG = 2e-3  # m


def wrong_scene(progress: Callable[[str], None]) -> dict:
    """Return figures of a loop with a tracker at a wall that is 2 mm nearer, or 2 mm farther away, than the model's scene has it.

    `wrong_scene_said`: share of these cases that say that measured and predicted motion disagree, and `right_scene_said`: of the
    case with the right scene; `wrong_scene_ripple_mm`: motion of the true tip at the end, worst of all cases;
    `wrong_scene_force_n`: largest force of the true wall, by how much nearer it is in mm.
    """
    setup, outcomes = Setup.of(load_robot_file("article"), 1), {}
    for nearer in (0.0, _WRONG, -_WRONG):
        progress(f"a wall that is {1e3 * nearer:g} mm nearer than the scene has it")
        outcomes[nearer] = run_wrong_scene((setup, WrongSceneCase(nearer, _TRACKER)))
    said = {nearer: any("disagree" in sentence for sentence in outcome.sentences) for nearer, outcome in outcomes.items()}
    return {
        "wrong_scene_said": 0.5 * (said[_WRONG] + said[-_WRONG]),
        "right_scene_said": float(said[0.0]),
        "wrong_scene_ripple_mm": 1e3 * max(outcome.ripple for outcome in outcomes.values()),
        "wrong_scene_force_n": {f"{1e3 * nearer:g}": outcome.peak for nearer, outcome in outcomes.items()},
    }
