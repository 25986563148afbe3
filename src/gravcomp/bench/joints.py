"""joint_bridge: hostile messages, and the closed loop through each kind of controller against the loop over CAN.

The controllers and joints are the stand-in of `virtual.joint_controller` and `virtual.joint_servos`; all in virtual time.
"""

import dataclasses
from collections.abc import Callable

from gravcomp.bench.joint_campaign import run as attack
from gravcomp.bench.joint_campaign import with_joints
from gravcomp.closed_loop.setup import Setup
from gravcomp.description import load_robot_file
from gravcomp.description.joint_motors import COMMANDS
from gravcomp.trials.turning_base import INCLINATIONS, residuals


def run(
    progress: Callable[[str], None],
    *,
    messages: int = 1_000_000,
    seed: int = 1,
    orientations: int = 5,
    loops: int = 3,
    poses: int = 5,
) -> dict:
    """Return the figures; the names of the keys give their units.

    messages: hostile messages; seed: of messages and virtual robot; orientations: of the base, in addition to the first `poses`
    of the article's five; loops: number of kinds of controllers whose loop is closed.
    """
    setup = Setup.of(load_robot_file("article"), seed)
    tallies = attack(setup.hardware, messages, seed, progress)
    kinds, found_loops = COMMANDS[:loops], {}
    for command in (None, *kinds):
        progress(f"closed loop, {command or 'CAN'}")
        hardware = setup.hardware if command is None else with_joints(setup.hardware, command)
        loop = dataclasses.replace(setup, hardware=hardware)
        found = residuals(loop, orientations, inclinations=INCLINATIONS[:poses])
        found_loops[command or "can"] = {"held_mm": round(1e3 * found.held, 3), "moving_mm": round(1e3 * found.moving, 3)}
    can = found_loops["can"]
    return {
        "robot": "virtual robot",
        "messages": sum(tally.messages for tally in tallies.values()),
        "violations": sum(tally.violations for tally in tallies.values()),
        "outputs": sum(tally.outputs for tally in tallies.values()),
        "followed": sum(tally.active for tally in tallies.values()),
        "latched_faults": sum(tally.latched for tally in tallies.values()),
        "loop": found_loops,
        "over_can_pct": {
            command: {key: round(100.0 * (found_loops[command][key] / can[key] - 1.0), 1) for key in can} for command in kinds
        },
    }
