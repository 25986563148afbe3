"""Free fall of the virtual robot: unloaded and at rest at first, with released cables and a base at rest."""

import dataclasses
from collections.abc import Iterator

import numpy as np

from gravcomp.calibration.measured import Measured
from gravcomp.closed_loop.setup import Setup
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.trials.resting_imu import gravity_at_rest
from gravcomp.trials.tracker import Tracker
from gravcomp.virtual.body import build_friction, build_material, build_rod
from gravcomp.virtual.dynamics import MovingRod
from gravcomp.virtual.equilibrium import RodShape
from gravcomp.virtual.motion import base_orientation

SAMPLE = 0.010  # s
FALL, BRIEF_FALL = 5.4, 1.3  # first periods of the robot: falls to which a motion is fitted
BRIEF_EVALUATIONS = 2  # of a brief fit to falls: a step is taken, but the values do not converge
_STEP = 0.002  # s
_RELEASED = -0.3  # of the length: paid out so far that the cables stay slack


def free_fall(job: tuple[Setup, float, float, float, int]) -> Measured:
    """Return the tip of a fall as a tracker sees it, to which a model is fitted, and the gravity estimated from the IMU.

    job: (setup, inclination and roll in deg, duration in s, number of the trial).
    """
    setup, *_, trial = job
    fall = true_fall(job)
    assert fall.tip_direction is not None
    random = np.random.default_rng([setup.seed, trial])
    tip, direction = Tracker().seen(setup.nominal.length, fall.tip_position, fall.tip_direction, random)
    return dataclasses.replace(fall, tip_position=tip, tip_direction=direction)


def true_fall(job: tuple[Setup, float, float, float, int]) -> Measured:
    """Return the true tip of a fall, by which a model is evaluated, and the gravity from the IMU; job: see `free_fall`."""
    setup, inclination, roll, duration, trial = job
    base = base_orientation(np.radians(inclination), np.radians(roll))
    tips, directions = zip(
        *((position[-1], orientation[-1, :, 2]) for position, orientation in falling_rod(setup, base, duration))
    )
    return Measured(
        source="virtual robot",
        trial=np.full(len(tips), trial),
        time=SAMPLE * np.arange(len(tips)),
        gravity=np.tile(gravity_at_rest(setup, base), (len(tips), 1)),
        displacement=np.full((len(tips), len(setup.nominal.cables)), np.nan),
        tip_position=np.array(tips) @ base,
        tip_direction=np.array(directions) @ base,
    )


def falling_rod(setup: Setup, base: np.ndarray, duration: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield positions (n, 3) in m and orientations (n, 3, 3) of the rod's nodes in the world, every `SAMPLE` s.

    base (3, 3): world from soft_base; duration in s.
    """
    true = setup.true_robot
    model = build_rod(true)
    rod = MovingRod(model, build_material(model, true), build_friction(true))
    none = np.zeros(model.tendons)
    rod.rest(RodShape(*model.unloaded(), tension=none, displacement=none, iterations=0), base, np.zeros(3))
    # Copies: the rod updates its arrays in place.
    yield rod.position.copy(), rod.orientation.copy()
    world_gravity = np.array([0.0, 0.0, -STANDARD_GRAVITY])
    for step in range(1, round(duration / _STEP) + 1):
        rod.step(_STEP, base, np.zeros(3), world_gravity, np.full(model.tendons, _RELEASED * setup.nominal.length))
        if step % round(SAMPLE / _STEP) == 0:
            yield rod.position.copy(), rod.orientation.copy()
