"""Evaluation of your own robot: a bag of its run is evaluated by the measures of the experiments on the virtual robot.

Each module has `run(recorded: RecordedRun) -> Result`. EVALUATIONS names the module for an experiment. Experiments that are not
in it need no robot, or values that a bag does not contain.
"""

from importlib import import_module
from types import ModuleType

from gravcomp.config import ConfigError

_HOLDING, _FALL, _DELAY, _IMU = "holding", "fall", "delay", "imu"
EVALUATIONS = {
    "imu-ablation": _IMU,
    "real2sim": _FALL,
    "static": _HOLDING,
    "long-segment": _HOLDING,
    "arm": _HOLDING,
    "hand-held": _HOLDING,
    "colonoscopy": _HOLDING,
    "delay": _DELAY,
}


def evaluation(name: str) -> ModuleType:
    """Return the module that evaluates a bag for the experiment `name`. Raises ConfigError where there is none."""
    if name not in EVALUATIONS:
        instead = (
            "`gravcomp calibrate BAG` fits the model to a bag"
            if name == "tuning"
            else f"a bag can be evaluated for {', '.join(EVALUATIONS)}"
        )
        raise ConfigError(f"'{name}' cannot be evaluated from a bag: {instead}")
    return import_module(f"gravcomp.evaluation.recorded.{EVALUATIONS[name]}")
