"""What the materials' branches (`full_model.viscosity`) hold in a reduced model, from one step to the next.

The branch holds H = int exp(-(t - s) / T) dE(s). Green's strain is quadratic in the coordinates, E = G q + 1/2 q . Q q at every
point of the body, so H is known at every point from two moments of the course of q:

    H = G p + 1/2 Q : M,      p = int exp(-(t - s) / T) dq,      M = int exp(-(t - s) / T) d(q q^T).

The reduced model needs only eta = <s_m, H>, which has the same recursion as H; p and M carry the memory to the full model without
loss. All are exact for branches that are the same in the whole robot and rates that are constant in a step.
"""

import dataclasses

import numpy as np

from gravcomp.full_model.viscosity import branch
from gravcomp.mechanics.total_lagrangian import SolidElements

# Shapes of M with less than this part of the largest one's weight are left out where M goes to the full model.
_NEGLIGIBLE = 1e-7


@dataclasses.dataclass(frozen=True)
class Memory:
    """Memory of b branches of a reduced model.

    ratio and time (b,): rho and T in s; q (r,) and strain (m,) of the last step; held (b, m): eta; first (b, r) and second
    (b, r, r): p and M.
    """

    ratio: np.ndarray
    time: np.ndarray
    q: np.ndarray
    strain: np.ndarray
    held: np.ndarray
    first: np.ndarray
    second: np.ndarray

    @staticmethod
    def of(branches: tuple[tuple[float, float], ...], q: np.ndarray, strain: np.ndarray) -> "Memory":
        """Return the relaxed memory at q (r,), where the strain is (m,). branches: of `description.Material`."""
        ratio, time = np.array(branches, dtype=float).reshape(-1, 2).T
        b, r = len(ratio), len(q)
        return Memory(ratio, time, q, strain, np.zeros((b, len(strain))), np.zeros((b, r)), np.zeros((b, r, r)))

    def relaxed(self, q: np.ndarray, strain: np.ndarray) -> "Memory":
        """Return the relaxed memory of the same branches at q (r,), where the strain is (m,)."""
        return Memory(self.ratio, self.time, q, strain, *(np.zeros_like(x) for x in (self.held, self.first, self.second)))

    def stress(self, h: float) -> tuple[float, np.ndarray]:
        """Return a and b (m,) of the stress a eps + b that the branches add at the end of a step of h s."""
        decay, gain = branch(h, self.time)
        stiffer = float(self.ratio @ gain)
        return stiffer, (self.ratio * decay) @ self.held - stiffer * self.strain

    def after(self, q: np.ndarray, strain: np.ndarray, h: float) -> "Memory":
        """Return the memory at the end of a step of h s to q (r,), where the strain is (m,)."""
        if not len(self.ratio):
            return dataclasses.replace(self, q=q, strain=strain)
        decay, gain = branch(h, self.time)
        square = np.outer(q, q) - np.outer(self.q, self.q)
        return dataclasses.replace(
            self,
            q=q,
            strain=strain,
            held=decay[:, None] * self.held + np.multiply.outer(gain, strain - self.strain),
            first=decay[:, None] * self.first + np.multiply.outer(gain, q - self.q),
            second=decay[:, None, None] * self.second + np.multiply.outer(gain, square),
        )

    def at_points(self, elements: SolidElements, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the strain (k, p, 6) and what the branches hold (b, k, p, 6) at the elements' points.

        basis (3 n_free, r): of the coordinates.
        """

        def strains(q: np.ndarray) -> np.ndarray:
            u = np.zeros_like(elements.mesh.nodes)
            u[: elements.n_free] = (basis @ q).reshape(-1, 3)
            return elements.strains(u)

        strain = strains(self.q)
        held = np.zeros((len(self.ratio), *strain.shape))
        for of, first, second in zip(held, self.first, self.second):
            of += 0.5 * (strains(first) - strains(-first))
            weight, shapes = np.linalg.eigh(second)
            for k in np.flatnonzero(np.abs(weight) > _NEGLIGIBLE * np.abs(weight).max()):
                of += 0.5 * weight[k] * (strains(shapes[:, k]) + strains(-shapes[:, k]))
        return strain, held
