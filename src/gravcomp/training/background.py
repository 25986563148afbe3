"""Build a robot's reduced model in the background, at low priority: `python -m gravcomp.training.background ROBOT`.

One process for each cache entry builds it; others wait for its lock and then find the entry. A killed process leaves the
samples that it has computed, and the next one goes on from there.
"""

import sys

from gravcomp.config import ConfigError
from gravcomp.environment.give_way import give_way
from gravcomp.mesh import MeshError


def main(arguments: list[str]) -> int:
    """Build the reduced model unless it exists; print when its file was written (ns) and the path.

    Returns 0, also for a robot that cannot be reduced, of which nothing is printed.
    """
    give_way()
    (robot,) = arguments
    from gravcomp.description import load_robot_file
    from gravcomp.full_model.robot_model import RobotModel
    from gravcomp.reduction import load, path_of, why_not
    from gravcomp.training.build import alone, build

    try:
        model = RobotModel(load_robot_file(robot).robot)
        if why_not(model):
            return 0
        if load(model) is None:
            with alone(model):
                if load(model) is None:  # not built by another process meanwhile
                    _say("is built in the background; the full model serves until then")
                    _, seconds = build(model, progress=_Quarters())
                    _say(f"was built in {seconds:.0f} s; the running simulator changes over to it")
        path = path_of(model)
        print(path.stat().st_mtime_ns, path, flush=True)
    except (ConfigError, MeshError) as error:
        _say(f"cannot be built: {error}")
    return 0


class _Quarters:
    """Prints the progress of the training at each quarter."""

    def __init__(self) -> None:
        self._printed = 0

    def __call__(self, stage: str, share: float) -> None:
        quarter = int(4 * share)
        if stage == "training" and self._printed < quarter < 4:
            self._printed = quarter
            _say(f"{25 * quarter} % of the training")


def _say(text: str) -> None:
    print(f"Reduced model: {text}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
