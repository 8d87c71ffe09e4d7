"""`cKDTree` and `Delaunay` of `scipy.spatial`, without the rest of that package.

Importing `scipy.spatial` takes 0.08 s of CPU, for rotations and distances that nobody here needs: more than all searches of a
usual model.  The two classes live in extension modules that depend on nothing else in it, so these are loaded alone, under their
own names; a later ``import scipy.spatial`` finds them.  Where SciPy has them elsewhere, the whole package is imported.
"""

from __future__ import annotations

import importlib
import importlib.machinery
import importlib.util
import sys
from typing import TYPE_CHECKING, Any

import scipy

if TYPE_CHECKING:
    from scipy.spatial import Delaunay, cKDTree

__all__ = ["Delaunay", "cKDTree"]

_HOME = {"cKDTree": "_ckdtree", "Delaunay": "_qhull"}


def _load(name: str) -> Any:
    module = f"scipy.spatial.{_HOME[name]}"
    if "scipy.spatial" in sys.modules or module in sys.modules:
        return getattr(sys.modules.get(module) or importlib.import_module("scipy.spatial"), name)
    places = [f"{path}/spatial" for path in scipy.__path__]
    spec = importlib.machinery.PathFinder.find_spec(module, places)
    if spec is None or spec.loader is None:
        return getattr(importlib.import_module("scipy.spatial"), name)
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[module] = loaded
    try:
        spec.loader.exec_module(loaded)
    except BaseException:
        del sys.modules[module]
        raise
    return getattr(loaded, name)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = _load(name)
    return value
