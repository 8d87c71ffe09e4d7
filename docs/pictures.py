"""Makes the pictures of the README: a mesh, and one for each source of cross fields.

python docs/pictures.py
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import meshio
import numpy as np
from PIL import Image

HERE = Path(__file__).resolve().parent
GEO = HERE.parent / "geo"
RADIUS = 0.25  # of the hole in plate_hole.geo


def stress(path: Path, ratio: float = 0.5) -> None:
    """Stress around a round hole in a large plate, pulled along x and `ratio` times as much along y (Kirsch 1898)."""
    r, a = np.meshgrid(RADIUS * np.geomspace(1.0, 8.0, 60), np.linspace(0, 2 * np.pi, 121)[:-1], indexing="ij")
    k = RADIUS / r
    mean, half = 0.5 * (1 + ratio), 0.5 * (1 - ratio)
    radial = mean * (1 - k**2) + half * (1 - 4 * k**2 + 3 * k**4) * np.cos(2 * a)
    hoop = mean * (1 + k**2) - half * (1 + 3 * k**4) * np.cos(2 * a)
    shear = -half * (1 + 2 * k**2 - 3 * k**4) * np.sin(2 * a)
    c, s = np.cos(a), np.sin(a)
    xx = radial * c * c + hoop * s * s - 2 * shear * s * c
    yy = radial * s * s + hoop * c * c + 2 * shear * s * c
    xy = (radial - hoop) * s * c + shear * (c * c - s * s)
    zero = np.zeros(r.size)
    points = np.stack([(r * c).ravel(), (r * s).ravel(), zero], axis=1)
    node = np.arange(r.size).reshape(r.shape)
    after = np.roll(node, -1, axis=1)
    quads = np.stack([node[:-1], node[1:], after[1:], after[:-1]], axis=-1).reshape(-1, 4)
    tensor = np.stack([xx.ravel(), yy.ravel(), zero, xy.ravel(), zero, zero], axis=1)
    meshio.Mesh(points, [("quad", quads)], point_data={"stress": tensor}).write(path)


def shrink(path: Path, width: int = 1500, colours: int = 64) -> None:
    """Make a picture small enough for a repository."""
    with Image.open(path) as picture:
        width = min(width, picture.width)
        size = width, round(picture.height * width / picture.width)
        small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS).quantize(colours)
    small.save(path, optimize=True)


def main() -> None:
    """Mesh every example and draw it."""
    with tempfile.TemporaryDirectory() as folder:
        stress(Path(folder) / "stress.vtu")
        (Path(folder) / "own.py").write_text(
            "import numpy as np\n\n\ndef star(p):\n    return np.angle((p[:, 0] + 1j * p[:, 1]) ** 5 - 0.1) / 4\n"
        )
        for name, model, *options in (
            ("plate_two_holes", "plate_two_holes", "--size", "0.05"),
            ("field_singularities", "disc", "--size", "0.08", "--field", "singularities:(-0.4,0):1,(0.4,0):1"),
            ("field_eigenmode", "naca0012", "--field", "eigenmode:4"),
            ("field_file", "plate_hole", "--size", "0.08", "--field", "stress.vtu:principal"),
            ("field_function", "circle", "--size", "0.08", "--field", "own:star", "--index", "1=-1/4"),
        ):
            picture = HERE / f"{name}.png"
            command = [sys.executable, "-m", "gmsh_crossquad", "mesh", str(GEO / f"{model}.geo"), "-o", "out.msh", *options]
            command += ["--picture", str(picture)]
            print(subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout.splitlines()[-1])
            shrink(picture)


if __name__ == "__main__":
    main()
