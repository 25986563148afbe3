"""Tip error with released cables, from the statics of the virtual robot."""

import numpy as np

from gravcomp.description import RobotFile

# Number of directions of gravity of a run that are solved; its motion is slow compared with their distance.
_DIRECTIONS = 40


def released_tip_error(robot_file: RobotFile, gravity: np.ndarray, target: np.ndarray, seed: int | None = None) -> float | None:
    """Return the RMS distance (m) of the released virtual robot's tip from `target` (3,) over the gravity (n, 3) m/s^2 of a run.

    seed: of the virtual robot, in place of the file's. None without an equilibrium at any of the directions.
    """
    from gravcomp.virtual.body import build_rod
    from gravcomp.virtual.described import described
    from gravcomp.virtual.equilibrium import NoEquilibrium, equilibrium

    rod = build_rod(described(robot_file, seed).draw())
    distances = []
    shape = None
    for direction in gravity[:: max(1, len(gravity) // _DIRECTIONS)]:
        try:
            shape = equilibrium(rod, direction, start=shape)
        except NoEquilibrium:
            shape = None
            continue
        distances.append(np.linalg.norm(shape.tip - target))
    return float(np.sqrt(np.mean(np.square(distances)))) if distances else None
