"""The pictures: the parts of the unaligned field beside field, layout and mesh of the aligned one, as small PNG files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from separatrices import Complex, Parts
from study import Study

from gmsh_crossquad.view.picture import draw_scene
from gmsh_crossquad.view.scene import BLUE, GREY, INK, VERMILLION, Lines, Markers, Panel, Scene, build_scene

PIXELS, COLOURS = 9e5, 60
WIDEST = 1.75  # wider panels would be drawn below each other
FOUR, OTHER = (205, 226, 240), (244, 190, 150)


def _flat(z: Complex) -> np.ndarray:
    return np.stack([z.real, z.imag, 0 * z.real], axis=-1)


def _inside(polygon: Complex, z: Complex) -> np.ndarray:
    """Even-odd rule."""
    a, b = polygon[:, None], np.roll(polygon, -1)[:, None]
    cut = (a.imag > z.imag) != (b.imag > z.imag)
    with np.errstate(divide="ignore", invalid="ignore"):
        x = a.real + (z.imag - a.imag) * (b.real - a.real) / (b.imag - a.imag)
    return np.sum(cut & (x > z.real), axis=0) % 2 == 1


def parts_panel(found: Parts, study: Study, title: str) -> Panel:
    """The parts, those without four corners in another colour."""
    from scipy.spatial import Delaunay

    everything = np.unique(np.concatenate([p.outline for p in found.parts]).round(12))
    cells = Delaunay(np.stack([everything.real, everything.imag], axis=1)).simplices
    middle = everything[cells].mean(axis=1)
    colours = np.full((len(cells), 3), 255)
    for part in found.parts:
        colours[_inside(part.outline, middle)] = FOUR if part.corners == 4 else OTHER
    used = (colours < 255).any(axis=1)
    lines = [np.stack([_flat(s[:-1]), _flat(s[1:])], axis=1) for s in found.separatrices]
    rim = [np.stack([_flat(b), _flat(np.roll(b, -1))], axis=1) for b in study.loops()]
    spots = np.array([s.point for s in study.result.singularities])
    sign = np.array([s.index for s in study.result.singularities])
    markers = [Markers(spots[k], c, 8.0, sq) for k, c, sq in ((sign > 0, VERMILLION, False), (sign < 0, BLUE, True)) if k.any()]
    strange = sum(p.corners != 4 for p in found.parts)
    return Panel(
        f"{title}: {strange} of {len(found.parts)} parts are not four-sided",
        _flat(everything),
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


def write(picture: Scene, path: Path) -> None:
    """Draw a scene; few colours keep the file small."""
    from PIL import Image

    draw_scene(picture, path)
    with Image.open(path) as image:
        small = image.convert("RGB")
        factor = min(1.0, (PIXELS / (small.width * small.height)) ** 0.5)
        small = small.resize((round(factor * small.width), round(factor * small.height)), Image.Resampling.LANCZOS)
        own = small.quantize(COLOURS).getpalette()
        assert own is not None
        palette = Image.new("P", (1, 1))
        palette.putpalette([c for colour in (BLUE, VERMILLION, INK) for c in colour] + own[: 3 * COLOURS])
        small.quantize(palette=palette, dither=Image.Dither.NONE).save(path, optimize=True)
