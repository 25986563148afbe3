"""Markers: points that move with the body, on it or standing out from it.

A marker inside the body moves with the element that contains it. A marker outside, such as a ball on a stalk or a plate, is
fixed rigidly to the nearest cross-section of the axis: x = p + R (X - P), where p is the section's place and R its rotation
(`full_model.observation`), P and X are section and marker at rest.
"""

import numpy as np

from gravcomp.full_model.observation import observe
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mesh.embedding import locate
from gravcomp.mesh.robot_axis import rest_axis
from gravcomp.mesh.sections import section_functionals

_SEARCHED = 400  # stations along the axis between which the nearest section is found
_INSIDE = 1e-6  # in local coordinates


class Markers:
    """Markers on a model. rigid (p,): whether a marker is fixed to a cross-section; station (p,): its height in m, NaN else."""

    def __init__(self, model: RobotModel, at: np.ndarray):
        """at (p, 3): markers at rest, in soft_base."""
        self._mesh, self._at = model.mesh, np.asarray(at, dtype=float).reshape(-1, 3)
        found, attached = locate(model.mesh, self._at)
        self.rigid = ~(attached & (found.outside < _INSIDE))
        self.station = np.full(len(self._at), np.nan)
        self._rows = np.zeros((len(self._at), len(model.mesh.nodes)))
        for index in np.flatnonzero(~self.rigid):
            np.add.at(self._rows[index], found.nodes[index], found.weights[index])
        if not self.rigid.any():
            return
        axis = rest_axis(model.robot)
        stations = np.linspace(0.0, model.length, _SEARCHED + 1)
        position, _ = axis.frames(stations)
        distance = ((self._at[self.rigid, None] - position) ** 2).sum(axis=2)
        self.station[self.rigid] = stations[distance.argmin(axis=1)]
        self._sections = section_functionals(model.mesh, self.station[self.rigid])
        rest, turned = self._frames(model.mesh.nodes)
        self._arm = np.einsum("pji,pj->pi", turned, self._at[self.rigid] - rest)

    def positions(self, u: np.ndarray) -> np.ndarray:
        """Return the markers' positions (p, 3) in m at the displacements u (n, 3) of the nodes."""
        x = self._mesh.nodes + u
        places = self._rows @ x
        if self.rigid.any():
            middle, turned = self._frames(x)
            places[self.rigid] = middle + np.einsum("pij,pj->pi", turned, self._arm)
        return places

    def _frames(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (r, 3) and rotations (r, 3, 3) of the sections that carry markers, at node positions x (n, 3)."""
        from scipy.spatial.transform import Rotation

        sections = (self._sections @ x).reshape(-1, 3, 3)
        _, _, orientation = observe(sections, np.zeros((*sections.shape, 0)))
        return sections[:, 0], Rotation.from_quat(orientation).as_matrix()
