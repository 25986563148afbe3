"""Which folder Numba caches compiled functions in: that of `numba_locator`, set when this package is imported."""

import os
import sys
from typing import Any

_LOCATORS = "gravcomp.numba_locator.ContentLocator,UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator"


def configure_numba() -> None:
    """Let Numba keep the functions of this package by their code, also where it was imported before.

    A NUMBA_CACHE_DIR or NUMBA_CACHE_LOCATOR_CLASSES of the user's own has precedence; then Numba decides by itself what is up to
    date.
    """
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    locators = os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", _LOCATORS)
    config: Any = sys.modules.get("numba.core.config")
    if config is not None and not config.CACHE_DIR and not config.CACHE_LOCATOR_CLASSES:
        config.CACHE_LOCATOR_CLASSES = locators  # the environment was read when Numba was imported
