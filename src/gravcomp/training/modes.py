"""The modes that a robot gets from its trained shapes, and whether more shapes would give better ones."""

import numpy as np

from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.symmetry import symmetries
from gravcomp.reduction.basis import energy_basis
from gravcomp.reduction.reduced_model import section_changes
from gravcomp.training.images import with_images
from gravcomp.training.samples import Sample
from gravcomp.training.trained_shapes import TrainedShapes, evenly

_MOST_NEW, _MOST_TRAINED = 0.95, 0.98
"""Share of new shapes that the modes have to represent, without the few near the end of the equilibria; and of trained ones."""


class Modes:
    """Modes of a model's shapes: `few`, or `many` where those do not represent the shapes.

    Attributes: maps: symmetries of the model, with whose images the shapes are trained.
    """

    def __init__(self, model: RobotModel, few: int, many: int, represented: float, decomposed: int):
        """represented: part of the length up to which a shape is represented; decomposed: most snapshots to decompose."""
        self._model, self._few, self._many = model, few, many
        self._represented, self._decomposed = represented, decomposed
        self._stiffness = model.new_matrix()
        model.elements.assemble(np.zeros_like(model.mesh.nodes), self._stiffness)
        self.maps = symmetries(model)

    def shapes(self, some: list[Sample]) -> TrainedShapes:
        """Return the shapes of the samples, without their images."""
        return TrainedShapes.of(some, self._stiffness)

    def basis_of(self, shapes: TrainedShapes) -> np.ndarray:
        """Return the modes (n, r) that the robot gets from these shapes, the most important ones first.

        Of modes for the energy and modes to which each shape counts alike: those that miss less of the shapes (mean square).
        """
        shown = shapes.part(evenly(len(shapes.rows), self._decomposed))
        gram = shown.gram()
        both = [energy_basis(shown.rows, self._stiffness.multiply, self._many, alike, gram) for alike in (False, True)]
        basis = min(both, key=lambda basis: float(np.mean(self._missed(basis, shapes) ** 2)))
        few = np.ascontiguousarray(basis[:, : self._few])
        return few if self._represent(few, shapes, _MOST_TRAINED) else basis

    def enough(self, earlier: list[Sample], new: list[Sample]) -> bool:
        """Return whether the modes of the earlier samples represent the new ones, or not even those of all: more do not help."""
        earlier = with_images(earlier, self.maps)
        if len(earlier) < self._many or not new:
            return False
        every = self.shapes(earlier + with_images(new, self.maps))
        before, unseen = every.part(slice(len(earlier))), every.part(slice(len(earlier), None, 1 + len(self.maps)))
        if self._represent(self.basis_of(before), unseen, _MOST_NEW):
            return True
        return not self._represent(self.basis_of(every), unseen, _MOST_NEW)

    def _missed(self, basis: np.ndarray, shapes: TrainedShapes) -> np.ndarray:
        """Return what the modes (n, r) miss of each shape (s,): at the section where it is most, over the length."""
        missing = section_changes(self._model, shapes.missing(basis).T)[:, 0]
        apart: np.ndarray = np.linalg.norm(missing, axis=1).max(axis=0) / self._model.length
        return apart

    def _represent(self, basis: np.ndarray, shapes: TrainedShapes, most: float) -> bool:
        """Return whether the modes (n, r) represent the share `most` of the shapes."""
        return bool(np.quantile(self._missed(basis, shapes), most) <= self._represented)
