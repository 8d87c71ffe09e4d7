"""`python -m gmsh_crossquad` is the command `gmsh-crossquad`."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
