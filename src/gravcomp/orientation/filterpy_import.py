"""Import of filterpy's Kalman filter without scipy.stats and scipy.ndimage, which takes most of its CPU time at a node's start.

filterpy imports them for the densities in `filterpy.stats` and for the grids in `filterpy.discrete_bayes`, which the filter's
equations do not use. During the import stand-ins take their places; what needs them loads them at its first use.
"""

import importlib
import sys
import types
from typing import Any

_NAMES = ("scipy.stats", "scipy.ndimage")


def kalman_filter_class() -> type:
    """Return `filterpy.kalman.KalmanFilter`."""
    missing = [] if "filterpy" in sys.modules else [name for name in _NAMES if name not in sys.modules]
    stand_ins = {name: _StandIn(name) for name in missing}
    sys.modules.update(stand_ins)
    try:
        from filterpy.kalman import KalmanFilter
    finally:
        for name, stand_in in stand_ins.items():
            del sys.modules[name]
            stand_in.is_importing = False
    return KalmanFilter


class _StandIn(types.ModuleType):
    """Stands for a module of SciPy: each name in it is a `_Later`."""

    is_importing = True

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # what the import system looks for
            raise AttributeError(name)
        return _Later(self, name)


class _Later:
    """An object of that module, loaded at its first use after the import."""

    def __init__(self, stand_in: _StandIn, name: str):
        self._stand_in, self._name = stand_in, name

    def __getattr__(self, name: str) -> Any:
        # filterpy calls one density while it is imported, to find out which keywords it has; SciPy has had them since 0.18.
        return _nothing if self._stand_in.is_importing else getattr(self._loaded(), name)

    def __call__(self, *args: Any, **options: Any) -> Any:
        return self._loaded()(*args, **options)

    def _loaded(self) -> Any:
        return getattr(importlib.import_module(self._stand_in.__name__), self._name)


def _nothing(*_: Any, **__: Any) -> None:
    return None
