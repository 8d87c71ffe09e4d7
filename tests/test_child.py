"""The child process: what it leaves unloaded."""

from __future__ import annotations

import subprocess
import sys

SCRIPT = """
import sys
from gmsh_crossquad.child import _UNUSED, _later
for name in _UNUSED:
    _later(name)
import numpy, scipy.sparse
assert not [m for m in sys.modules if m.startswith(("numpy.f2py.", "numpy.testing."))], "they were loaded"
numpy.testing.assert_array_equal([1], [1])
assert numpy.f2py.get_include() and "numpy.testing._private.utils" in sys.modules
"""


def test_what_nothing_uses_is_loaded_only_when_it_is_used() -> None:
    subprocess.run([sys.executable, "-c", SCRIPT], check=True)
