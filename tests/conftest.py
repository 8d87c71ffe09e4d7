"""Fixtures that several test files share."""

from __future__ import annotations

from collections.abc import Iterator

import gmsh
import pytest


def _session() -> Iterator[None]:
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield
    if gmsh.isInitialized():
        gmsh.finalize()


gmsh_session = pytest.fixture(scope="module", name="gmsh_session")(_session)
fresh_gmsh = pytest.fixture(name="fresh_gmsh")(_session)
