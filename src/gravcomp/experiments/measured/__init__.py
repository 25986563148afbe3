"""The model against what others measured or computed: `reproduce measured DATA`.

Each module of this package evaluates one folder of DATA and returns a `Part`. None of the measurements belongs to this
repository; a folder that is missing is left out, with a note, and one that cannot be used does not take the others with it.
"""

import os
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from gravcomp.config import ConfigError
from gravcomp.report.result import Result

TITLE = "Measured by others"
PARTS = ("tentacle", "beam", "tdcr", "disks", "rod_wrench")


def default_folder() -> Path:
    """Return $GRAVCOMP_DATA, by default ../shared/data next to the repository."""
    root = os.environ.get("GRAVCOMP_DATA")
    # src/gravcomp/experiments/measured/THIS -> folder of the repository
    return Path(root) if root else Path(__file__).resolve().parents[4].parent / "shared" / "data"


def run(
    folder: Path, progress: Callable[[str], None] = lambda stage: None, names: tuple[str, ...] = PARTS, brief: bool = False
) -> Result:
    """Evaluate the parts whose data are in the folder. Those that cannot be used are the `failures` of the result.

    Raises ConfigError if there is none, or none that can be used.
    """
    from gravcomp.calibration.measured import MeasurementError

    found, notes, failures = [], [], []
    for name in names:
        if not (folder / name).is_dir():
            notes.append(f"{name}: {folder / name} does not exist; left out")
            continue
        module = import_module(f"gravcomp.experiments.measured.{name}")

        def show(stage: str, name: str = name) -> None:
            progress(f"{name}: {stage}")

        try:
            found.append(module.evaluate(folder / name, show, brief))
        except (MeasurementError, RuntimeError) as error:
            failures.append(str(error))
    if failures and not found:
        raise ConfigError("\n".join(failures))
    if not found:
        what = "contains none of the folders" if folder.is_dir() else "is no folder; needed is one with"
        raise ConfigError(f"{folder}: {what} {', '.join(names)}")
    return Result(
        name="measured",
        title=TITLE,
        question="How well does the model predict what others measured, once the few unknown numbers are fitted?",
        ground="Measurements and computations of other authors, named in the README of each folder. Computed in the core.",
        figures=[figure for part in found for figure in part.figures],
        parts=[entry for part in found for entry in part.parts],
        failures=failures,
        notes=notes + [f"left out: {failure}" for failure in failures] + [note for part in found for note in part.notes],
        data={key: value for part in found for key, value in part.data.items()},
        parameters={"folder": str(folder)},
    )
