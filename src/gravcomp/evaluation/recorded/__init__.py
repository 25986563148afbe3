"""Experiments on a robot of one's own: a bag that was recorded while it ran is judged as the virtual robot is.

A module each with `run(recorded: RecordedRun) -> Result`. JUDGES names the one for an experiment; those that are not in it need no robot, or
judge what a bag does not hold.
"""

from importlib import import_module
from types import ModuleType

from gravcomp.config import ConfigError

_HOLDING, _FALL, _DELAY, _IMU = "holding", "fall", "delay", "imu"
JUDGES = {
    "imu-ablation": _IMU,
    "real2sim": _FALL,
    "static": _HOLDING,
    "long-segment": _HOLDING,
    "arm": _HOLDING,
    "hand-held": _HOLDING,
    "colonoscopy": _HOLDING,
    "delay": _DELAY,
}


def judge(name: str) -> ModuleType:
    """The module that judges a bag for the experiment `name`. Raises ConfigError when a bag cannot tell it."""
    if name not in JUDGES:
        instead = (
            "`gravcomp calibrate BAG` fits the model to a bag"
            if name == "tuning"
            else f"a bag can be judged for {', '.join(JUDGES)}"
        )
        raise ConfigError(f"'{name}' cannot be judged from a bag: {instead}")
    return import_module(f"gravcomp.evaluation.recorded.{JUDGES[name]}")
