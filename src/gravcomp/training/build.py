"""Building of a robot's reduction: sample, decompose, integrate, and test on motions that are not in the training set."""

import contextlib
import fcntl
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from gravcomp.cache import content_key
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.statics import StaticSolver
from gravcomp.materials.laws import LAWS
from gravcomp.mesh import MeshError
from gravcomp.reduction.cubature import Cubature, choose
from gravcomp.reduction.reduced_model import section_changes
from gravcomp.reduction.serving import ReducedServing
from gravcomp.reduction.store import Reduction, first_modulus, path_of, save, why_not
from gravcomp.reduction.strain_polynomials import strain_polynomials
from gravcomp.training.compliance import compliances
from gravcomp.training.images import with_images
from gravcomp.training.modes import Modes
from gravcomp.training.samples import TrainingOptions, samples
from gravcomp.training.smallest import smallest
from gravcomp.training.tip_errors import tip_errors
from gravcomp.training.trained_shapes import evenly

# The model may be used up to the trained |q| times this factor; its error is measured in any case.
_MARGIN = 1.3


@dataclass(frozen=True)
class BuildOptions:
    """Size of a reduction and of its training.

    modes: r; loaded_modes: more of them for a robot that carries external loads; more_modes: and for one whose trained shapes
    they do not represent; strains: number of principal strains in addition to those of the modes; more_strains: more of them
    where such a robot has a law with points: its strains are large; decomposed: largest number of snapshots to decompose,
    strained: and to find the principal strains in; integrated: number of shapes to choose the cubature of the law's deviation
    with, cubature its tolerance; up to `few_points`, which cost a step hardly any time, half of it is to be left, and with
    `board_points`, for which the board has room, twice the tolerance is enough; represented: the training ends when the modes of
    earlier paths represent new ones to this part of the length; training and test: motions to train and to test with.
    """

    modes: int = 44
    loaded_modes: int = 12
    more_modes: int = 12
    strains: int = 36
    more_strains: int = 20
    decomposed: int = 1100
    strained: int = 500
    integrated: int = 150
    cubature: float = 1e-4
    few_points: int = 64
    board_points: int = 128
    represented: float = 2e-4
    training: TrainingOptions = field(default_factory=TrainingOptions)
    test: TrainingOptions = field(default_factory=lambda: TrainingOptions(paths=6, steps=10, seed=1000))


def build(
    model: RobotModel, options: BuildOptions | None = None, progress: Callable[[str, float], None] = lambda stage, share: None
) -> tuple[Reduction, float]:
    """Build and store the model's reduction; return it and the time that it took in s.

    options: default `BuildOptions()`; progress: called with the stage and the fraction of it that is done. Raises MeshError for
    a robot that cannot be reduced, and if the full model finds too few equilibria.
    """
    options = options or BuildOptions()
    started = time.perf_counter()
    kept = path_of(model).with_suffix(".training") / content_key(options.training)
    reduction = trained(model, options, progress, kept)
    unseen = samples(model, options.test, lambda share: progress("testing", share))
    errors = tip_errors(model, reduction.reduced_model(model), unseen)
    errors = errors[np.isfinite(errors)]
    if not errors.size:
        raise MeshError("the reduced model finds none of the test's equilibria: the full model is used")
    reduction = replace(reduction, error_median=float(np.median(errors)), error_worst=float(errors.max()))
    # A running simulator must find everything compiled when it finds the file.
    ReducedServing(model, reduction.reduced_model(model), StaticSolver(model)).warm_up()
    save(reduction, path_of(model))
    shutil.rmtree(kept.parent, ignore_errors=True)
    return reduction, time.perf_counter() - started


def trained(
    model: RobotModel,
    options: BuildOptions,
    progress: Callable[[str, float], None] = lambda stage, share: None,
    kept: Path | None = None,
) -> Reduction:
    """Return the model's reduction from shapes of the full model, without its errors; it is not stored.

    kept: folder in which the samples of each path are stored until the end. Raises MeshError as `build` does.
    """
    reason = why_not(model)
    if reason:
        raise MeshError(reason)
    few = options.modes + (options.loaded_modes if model.robot.max_wrench else 0)
    exact = all(LAWS[material.law].quadratic for material in model.mesh.materials)
    modes = Modes(model, few, few + options.more_modes, options.represented, options.decomposed)
    turns = 1 + sum(np.linalg.det(symmetry.matrix) > 0.0 for symmetry in modes.maps)
    computed = samples(model, options.training, lambda share: progress("training", share), kept, modes.enough, turns=turns)
    found = with_images(computed, modes.maps)
    if len(found) < few:
        raise MeshError(
            f"only {len(found)} equilibria were found for the training, at least {few} are needed;"
            " the robot may be too soft for its weight"
        )
    progress("decomposing", 0.0)
    shapes = modes.shapes(found)
    basis = modes.basis_of(shapes)
    progress("integrating", 0.0)
    shown = shapes.rows[evenly(len(found), options.decomposed)]
    strains = options.strains + (0 if exact or basis.shape[1] == few else options.more_strains)
    elasticity = strain_polynomials(model.elements, basis, shown[evenly(len(shown), options.strained)], strains)
    low, high = options.training.modulus_range
    modulus = first_modulus(model)
    coordinates = shapes.coordinates(basis)
    cubature = Cubature.none()
    if not exact:
        sections = section_changes(model, basis)[:, 0] / model.length
        some = evenly(len(found), options.integrated)
        compliance = compliances(model, basis, [found[number] for number in some])
        room, few_points = options.board_points, options.few_points
        cubature = choose(model.elements, basis, coordinates[some], compliance, sections, options.cubature, room, few_points)
    whole = Reduction(
        basis=basis,
        elasticity=elasticity,
        cubature=cubature,
        reach=_MARGIN * float(np.linalg.norm(coordinates, axis=1).max()),
        modulus=modulus,
        modulus_low=low * modulus,
        modulus_high=high * modulus,
        samples=len(computed),
        error_median=np.nan,
        error_worst=np.nan,
    )
    return smallest(model, whole, computed, few, options.represented, lambda share: progress("choosing its size", share))


@contextlib.contextmanager
def alone(model: RobotModel, waiting: Callable[[], None] = lambda: None) -> Iterator[None]:
    """Context in which no other process builds the same reduction. waiting: called when another process has to end first."""
    with open(path_of(model).with_suffix(".lock"), "w", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            waiting()
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
