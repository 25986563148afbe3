"""Pick up a reduced model that is built while the simulator already runs on the full model.

A thread looks for the stored model once a second, loads it and compiles what it needs; the simulator's own thread only
exchanges it between two steps.
"""

import threading
from typing import Any

from gravcomp.reduction.store import path_of, why_not
from gravcomp.simulation.dynamic_simulator import DynamicSimulator
from gravcomp.simulation.simulator import Simulator

_PERIOD = 1.0  # s


class LateReduction:
    """Gives `simulator` its reduced model when that is built. Call `exchange` before a step, and `stop` at the end.

    `missing`: whether the reduced model is not there yet but can be built; otherwise there is nothing to do and no thread.
    """

    def __init__(self, simulator: Simulator | DynamicSimulator, period: float = _PERIOD):
        self._simulator = simulator
        self._period = period
        self._loaded: Any = None  # what `load_reduced` of the simulator returns
        self._ended = threading.Event()
        statics = simulator.statics if isinstance(simulator, DynamicSimulator) else simulator
        self._path = path_of(statics.model)
        self.missing = statics.reduced_model is None and not why_not(statics.model)
        self._thread = threading.Thread(target=self._look, name="late reduction", daemon=True)
        if self.missing:
            self._thread.start()

    def exchange(self) -> bool:
        """Let the simulator serve by the reduced model if it has been loaded since the last call; returns whether it has."""
        if self._loaded is None:
            return False
        self._simulator.adopt(self._loaded)
        self._loaded, self.missing = None, False
        return True

    def stop(self) -> None:
        """End the thread."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(5.0)

    def _look(self) -> None:
        seen = 0
        while not self._ended.wait(self._period):
            stamp = self._path.stat().st_mtime_ns if self._path.exists() else 0
            if stamp == seen:
                continue
            seen = stamp  # one that does not cover this robot's modulus may be replaced by another
            loaded = self._simulator.load_reduced()
            if loaded is not None:
                loaded.warm_up()
                self._loaded = loaded
                return
