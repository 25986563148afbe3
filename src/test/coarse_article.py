"""The article's robot in a coarse mesh, with a reduced model that one process of a run builds for all tests."""

import contextlib
import dataclasses
from collections.abc import Iterator
from pathlib import Path

import pytest

from gravcomp.cache import cache_folder
from gravcomp.description import Elements, Robot, load_robot_file
from gravcomp.reduction import Reduction, load
from gravcomp.simulation import RobotModel
from gravcomp.training import BuildOptions, TrainingOptions, build
from gravcomp.training.build import alone

# Little training: enough to keep this robot straight.
SMALL = BuildOptions(
    modes=30,
    more_modes=0,
    strains=24,
    training=TrainingOptions(paths=36, steps=6, bend=0.3),
    test=TrainingOptions(paths=2, steps=4, bend=0.3, seed=1000),
)


def coarse(robot: Robot | None = None) -> Robot:
    """The robot, by default the article's, in a coarse mesh."""
    return dataclasses.replace(robot or load_robot_file("article").robot, elements=Elements(around=4, along=4))


@contextlib.contextmanager
def cache_of_the_run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Context with a cache that is empty at the start of a run, but for compiled functions, and that its processes share."""
    folder = of_the_run(tmp_path_factory) / "gravcomp_cache"
    keep_compiled(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GRAVCOMP_CACHE", str(folder))
        yield


def of_the_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that all processes of a run share."""
    own = tmp_path_factory.getbasetemp()
    # Not by the environment of pytest-xdist, which a run that a test starts inherits.
    return own.parent if own.name.startswith("popen-") else own


def keep_compiled(folder: Path, *kinds: str) -> None:
    """Give another cache the compiled functions of this one, and its entries of other kinds: to make them again takes longer."""
    folder.mkdir(parents=True, exist_ok=True)
    for kind in ("numba", *kinds):
        with contextlib.suppress(FileExistsError):
            (folder / kind).symlink_to(cache_folder(kind))


def built_once(robot: Robot) -> tuple[RobotModel, Reduction]:
    """A model and its reduction, built where no other process of the run has done it; in the context of the run's cache."""
    model = RobotModel(robot)
    with alone(model):
        return model, load(model) or build(model, SMALL)[0]
