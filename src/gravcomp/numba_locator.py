"""Numba's cache of this package's functions, by content; named in NUMBA_CACHE_LOCATOR_CLASSES by `compiled_functions`."""

import functools
from collections.abc import Callable
from pathlib import Path

from numba.core.caching import _CacheLocator  # Numba documents no public base class for locators

from gravcomp.compiled_functions import PACKAGE, module_folder

_folder = functools.cache(module_folder)


class ContentLocator(_CacheLocator):
    """Places the compiled code of a function of this package in the folder of the code that it consists of."""

    def __init__(self, module: Path):
        self._folder = _folder(".".join(["gravcomp", *module.with_suffix("").parts]).removesuffix(".__init__"))
        self._path = self._folder / module.with_suffix("")

    @classmethod
    def from_function(cls, py_func: Callable, py_file: str) -> "ContentLocator | None":
        """Return the locator of a function; None for functions of other packages."""
        path = Path(py_file)
        return cls(path.relative_to(PACKAGE)) if path.is_relative_to(PACKAGE) else None

    def get_cache_path(self) -> str:
        """Return the folder of the function's compiled code."""
        return str(self._path)

    def get_source_stamp(self) -> str:
        """Return what must be equal for the compiled code to be valid: the folder's name stands for all code."""
        return self._folder.name

    def get_disambiguator(self) -> str:
        """Return what tells functions of one name in one module apart: nothing, their qualified names do."""
        return ""
