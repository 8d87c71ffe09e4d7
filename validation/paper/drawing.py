"""The pictures: the parts of the unaligned field beside field, layout and mesh of the aligned one, as small PNG files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from separatrices import STEP, Complex, Parts
from study import Study

from gmsh_crossquad.view.picture import draw_scene
from gmsh_crossquad.view.scene import (
    AMBIENT,
    BLUE,
    GREY,
    INK,
    LIGHT,
    VERMILLION,
    Lines,
    Markers,
    Panel,
    Scene,
    build_field_scene,
    build_scene,
)

PIXELS, COLOURS, SHADES = 8e5, 60, 150
WIDEST = 1.75  # wider panels would be drawn below each other
FOUR, OTHER = (205, 226, 240), (244, 190, 150)


def _view(study: Study) -> np.ndarray:
    """The rows right, up, towards the viewer of the result's own panels."""
    return np.linalg.lstsq(study.result.mesh.points, build_scene(study.result).panels[1].points, rcond=None)[0].T


def _inside(polygon: Complex, z: Complex) -> np.ndarray:
    """Even-odd rule."""
    a, b = polygon[:, None], np.roll(polygon, -1)[:, None]
    cut = (a.imag > z.imag) != (b.imag > z.imag)
    with np.errstate(divide="ignore", invalid="ignore"):
        x = a.real + (z.imag - a.imag) * (b.real - a.real) / (b.imag - a.imag)
    return np.sum(cut & (x > z.real), axis=0) % 2 == 1


def _between(z: Complex) -> Complex:
    """A grid over the box of places, without its points near these."""
    from scipy.spatial import cKDTree

    low, high = complex(z.real.min(), z.imag.min()), complex(z.real.max(), z.imag.max())
    step = STEP * abs(high - low)
    x, y = np.arange(low.real, high.real, step), np.arange(low.imag, high.imag, step)
    grid = (x[:, None] + 1j * y).ravel()
    near = cKDTree(np.stack([z.real, z.imag], axis=1)).query(np.stack([grid.real, grid.imag], axis=1))[0]
    return grid[near > 0.7 * step]


def _divided(s: Complex) -> Complex:
    """A polyline whose first segment, across the neighbourhood of a singular point, is short pieces."""
    return np.concatenate([s[0] + np.arange(10) / 10 * (s[1] - s[0]), s[1:]])


def _lit(colours: np.ndarray, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Colours of cells in the view's light."""
    corner = points[cells]
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    slope = np.abs(area @ LIGHT) / np.linalg.norm(area, axis=1)
    return np.rint(colours * (AMBIENT + (1.0 - AMBIENT) * slope)[:, None]).astype(np.int64)


def parts_panel(found: Parts, study: Study, title: str) -> Panel:
    """The parts, those without four corners in another colour."""
    from scipy.spatial import Delaunay

    curved, view = study.face.curved, _view(study) if study.face.curved else np.eye(3)
    everything = np.unique(np.concatenate([p.outline for p in found.parts]).round(12))
    if curved:  # cells that follow the surface
        everything = np.concatenate([everything, _between(everything)])

    def place(z: Complex) -> np.ndarray:
        return study.lift(z) @ view.T

    cells = Delaunay(np.stack([everything.real, everything.imag], axis=1)).simplices
    middle = everything[cells].mean(axis=1)
    colours = np.full((len(cells), 3), 255)
    for part in found.parts:
        colours[_inside(part.outline, middle)] = FOUR if part.corners == 4 else OTHER
    used = (colours < 255).any(axis=1)
    points = place(everything)
    if curved:
        colours = _lit(colours, points, cells)
    lines = [np.stack([place(s[:-1]), place(s[1:])], axis=1) for s in map(_divided, found.separatrices)]
    rim = [np.stack([place(b), place(np.roll(b, -1))], axis=1) for b in study.loops()]
    spots = place(np.array([z for z, _ in study.singular()]))
    sign = np.array([q for _, q in study.singular()])
    markers = [Markers(spots[k], c, 8.0, sq) for k, c, sq in ((sign > 0, VERMILLION, False), (sign < 0, BLUE, True)) if k.any()]
    strange = sum(p.corners != 4 for p in found.parts)
    return Panel(
        f"{title}: {strange} of {len(found.parts)} parts are not four-sided",
        points,
        cells[used],
        colours[used],
        (Lines(np.concatenate(lines), GREY if strange else INK, 1.4), Lines(np.concatenate(rim), INK, 2.0)),
        tuple(markers),
    )


def scene(study: Study, *more: Panel) -> Scene:
    """Panels before those of the result: field, layout, mesh."""
    own = build_scene(study.result)
    panels = (*more, *own.panels[1:]) if more else own.panels
    low, high = own.extent
    missing = max(0.0, (high - low)[0] / WIDEST - (high - low)[1])
    return Scene(panels, np.stack([low - [0.0, missing / 2], high + [0.0, missing / 2]]))


def given_panel(study: Study) -> Panel:
    """The given field."""
    return replace(build_field_scene(study.result.field).panels[0], title="given field")


def gallery(studies: dict[str, Study]) -> Scene:
    """The blocks and quads of several results, all of one size."""
    panels = []
    for name, study in studies.items():
        layout, mesh = build_scene(study.result).panels[1:]
        low, high = layout.points.min(axis=0), layout.points.max(axis=0)
        middle, size = 0.5 * (low + high), float((high - low)[:2].max())

        def moved(points: np.ndarray, middle: np.ndarray = middle, size: float = size) -> np.ndarray:
            return (points - middle) / size

        quality = study.result.quality
        blocks = f"{quality.blocks} block" + ("s" if quality.blocks > 1 else "")
        panels.append(
            Panel(
                f"{name}: {quality.quads} quads in {blocks}, scaled Jacobian min {quality.min_scaled_jacobian:.2f}",
                moved(layout.points),
                layout.cells,
                layout.colours,
                tuple(replace(x, segments=moved(x.segments)) for x in (mesh.lines[0], *layout.lines)),
                tuple(replace(x, points=moved(x.points)) for x in layout.markers),
            )
        )
    return Scene(tuple(panels), np.array([[-0.5, -0.5], [0.5, 0.5]]))


def write(picture: Scene, path: Path) -> None:
    """Draw a scene; few colours keep the file small (more of them where surfaces are lit)."""
    from PIL import Image

    draw_scene(picture, path)
    with Image.open(path) as image:
        small = image.convert("RGB")
        factor = min(1.0, (PIXELS / (small.width * small.height)) ** 0.5)
        small = small.resize((round(factor * small.width), round(factor * small.height)), Image.Resampling.LANCZOS)
        lit = len(np.unique(picture.panels[-2].colours, axis=0)) > COLOURS
        colours = SHADES if lit else COLOURS
        own = small.quantize(colours, kmeans=2 if lit else 0).getpalette()
        assert own is not None
        palette = Image.new("P", (1, 1))
        palette.putpalette([c for colour in (BLUE, VERMILLION, INK) for c in colour] + own[: 3 * colours])
        small.quantize(palette=palette, dither=Image.Dither.NONE).save(path, optimize=True)
