"""Constants of the materials, element by element."""

import dataclasses

import numpy as np

from gravcomp.materials.laws import LAWS
from gravcomp.mesh import Mesh


@dataclasses.dataclass(frozen=True)
class MaterialConstants:
    """Law and constants of k elements.

    law (k,): codes of `laws.LAWS`; values (k, c): lambda and mu of small strain in Pa, then the law's own constants, and zeros
    where another element has more; density (k,) in kg/m^3.
    """

    law: np.ndarray
    values: np.ndarray
    density: np.ndarray

    @property
    def first(self) -> np.ndarray:
        """(k,) Lame's first constant lambda of small strain in Pa."""
        return self.values[:, 0]

    @property
    def shear(self) -> np.ndarray:
        """(k,) shear modulus mu of small strain in Pa."""
        return self.values[:, 1]

    @staticmethod
    def of(mesh: Mesh) -> "MaterialConstants":
        """Return the constants that the mesh's materials give its elements."""
        young = np.array([m.youngs_modulus for m in mesh.materials])
        nu = np.array([m.poissons_ratio for m in mesh.materials])
        laws = [LAWS[m.law] for m in mesh.materials]
        values = np.zeros((len(laws), 2 + max(len(law.own_constants) for law in laws)))
        values[:, 0], values[:, 1] = young * nu / ((1 + nu) * (1 - 2 * nu)), young / (2 * (1 + nu))
        for row, (material, law) in enumerate(zip(mesh.materials, laws)):
            values[row, 2 : 2 + len(law.own_constants)] = [getattr(material, name) for name in law.own_constants]
        code = np.array([law.code for law in laws], dtype=np.int64)
        density = np.array([m.density for m in mesh.materials])
        return MaterialConstants(code[mesh.region], np.ascontiguousarray(values[mesh.region]), density[mesh.region])
