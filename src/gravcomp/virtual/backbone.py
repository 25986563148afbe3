"""Poses along the rod between its cross-sections, compiled: each element is a helix of constant strain."""

import numpy as np
from numba import njit

from gravcomp.virtual.se3 import advance, copy_pose, motion_exp, rotation_to_quaternion


@njit(cache=True, error_model="numpy")
def backbone_poses(
    station: np.ndarray,
    node_station: np.ndarray,
    orientation: np.ndarray,
    position: np.ndarray,
    strain: np.ndarray,
    length: np.ndarray,
    out_position: np.ndarray,
    out_orientation: np.ndarray,
) -> None:
    """Write the poses at station (k,) to out_position (k, 3) and out_orientation (k, 4), x y z w, in the frame of the base.

    node_station (n + 1,) are the stations of the cross-sections with orientation (n + 1, 3, 3) and position (n + 1, 3); strain
    (n, 6) and length (n,) are those of the elements.
    """
    turn, shift, work, relative = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    here, place = np.empty((3, 3)), np.empty(3)
    base, origin = orientation[0], position[0]
    for s in range(station.shape[0]):
        e = min(max(np.searchsorted(node_station, station[s], side="right") - 1, 0), length.shape[0] - 1)
        part = (station[s] - node_station[e]) / (node_station[e + 1] - node_station[e])
        motion_exp(part * length[e] * strain[e], turn, shift)
        copy_pose(orientation[e], position[e], here, place)
        advance(here, place, turn, shift, work)
        for i in range(3):
            out_position[s, i] = 0.0
            for k in range(3):
                out_position[s, i] += base[k, i] * (place[k] - origin[k])
            for j in range(3):
                relative[i, j] = base[0, i] * here[0, j] + base[1, i] * here[1, j] + base[2, i] * here[2, j]
        rotation_to_quaternion(relative, out_orientation[s])
