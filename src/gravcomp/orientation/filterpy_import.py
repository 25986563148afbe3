"""Import of filterpy's Kalman filter without scipy.stats, which takes half a second of CPU time at the start of each node.

filterpy imports scipy.stats for the densities in `filterpy.stats`, which the filter's equations do not use. During the import a
stand-in takes its place; the densities load scipy.stats at their first use.
"""

import importlib
import sys
import types
from typing import Any

_NAME = "scipy.stats"


def kalman_filter_class() -> type:
    """Return `filterpy.kalman.KalmanFilter`."""
    if _NAME in sys.modules or "filterpy.stats" in sys.modules:
        from filterpy.kalman import KalmanFilter

        return KalmanFilter
    stand_in = _StandIn(_NAME)
    sys.modules[_NAME] = stand_in
    try:
        from filterpy.kalman import KalmanFilter
    finally:
        del sys.modules[_NAME]
        stand_in.is_importing = False
    return KalmanFilter


class _StandIn(types.ModuleType):
    """Stands for scipy.stats: each name in it is a `_Later`."""

    is_importing = True

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # what the import system looks for
            raise AttributeError(name)
        return _Later(self, name)


class _Later:
    """An object of scipy.stats that is loaded at its first use after the import."""

    def __init__(self, stand_in: _StandIn, name: str):
        self._stand_in, self._name = stand_in, name

    def __getattr__(self, name: str) -> Any:
        # filterpy calls one density while it is imported, to find out which keywords it has; SciPy has had them since 0.18.
        return _nothing if self._stand_in.is_importing else getattr(self._loaded(), name)

    def __call__(self, *args: Any, **options: Any) -> Any:
        return self._loaded()(*args, **options)

    def _loaded(self) -> Any:
        return getattr(importlib.import_module(_NAME), self._name)


def _nothing(*_: Any, **__: Any) -> None:
    return None
