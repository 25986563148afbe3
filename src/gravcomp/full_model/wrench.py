"""A force and a moment on one cross-section: a dead load, constant in the base frame.

The force acts at the section's p (`mesh.sections`) and is linear in the nodes. A moment M does the work M . dphi on a small
rotation of the section,

    dphi = f_1 (d . df_2) - f_2 (d . df_1) + d (f_2 . df_1 - f_1 . df_2) / 2,      d = f_1 x f_2,

for unit vectors f_1, f_2, so that it pulls at f_1 and f_2 by forces that depend on where the section has turned.
"""

import dataclasses

import numpy as np

from gravcomp.full_model.model import MeshedModel
from gravcomp.mesh.sections import section_functionals


@dataclasses.dataclass(frozen=True)
class Wrench:
    """force (3,) in N and moment (3,) in N m, in soft_base, at `station`: 0 at the base to 1 at the tip."""

    force: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    moment: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    station: float = 1.0

    def __post_init__(self) -> None:
        for name in ("force", "moment"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ValueError(f"{name} is {value}; three finite numbers are needed")
            object.__setattr__(self, name, value)
        if not 0.0 <= self.station <= 1.0:
            raise ValueError(f"station is {self.station}; allowed: 0 at the base to 1 at the tip")


class PointLoads:
    """The loads of some wrenches on a model. constant: no moment is among them."""

    def __init__(self, model: MeshedModel, wrenches: tuple[Wrench, ...]):
        self._model = model
        rows = section_functionals(model.mesh, np.array([wrench.station for wrench in wrenches]) * model.length)
        self._rows = rows.reshape(len(wrenches), 3, len(model.mesh.nodes))
        self._wrenches = wrenches
        self.constant = not any(wrench.moment.any() for wrench in wrenches)

    @staticmethod
    def of(model: MeshedModel, wrench: "Wrench | tuple[Wrench, ...] | None") -> "PointLoads | None":
        """Return the loads of one wrench or several; None without any."""
        wrenches = (wrench,) if isinstance(wrench, Wrench) else wrench
        return PointLoads(model, tuple(wrenches)) if wrenches else None

    def at(self, u: np.ndarray, fraction: float = 1.0) -> np.ndarray:
        """Return the forces (3 n_free,) in N on the unknowns at the displacements u (n, 3), `fraction` of the whole load."""
        load = np.zeros_like(u)
        for wrench, (p, f1, f2) in zip(self._wrenches, self._rows):
            load += np.outer(p, wrench.force)
            if wrench.moment.any():
                x = self._model.mesh.nodes + u
                one, two = f1 @ x, f2 @ x
                d = np.cross(one, two)
                d /= np.linalg.norm(d)
                a, b = one / (one @ one), two / (two @ two)
                about = wrench.moment
                load += np.outer(f1, -(about @ b) * d + 0.5 * (about @ d) * b)
                load += np.outer(f2, (about @ a) * d - 0.5 * (about @ d) * a)
        return fraction * self._model.free(load)
