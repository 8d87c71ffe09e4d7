"""Drawing a `Scene` into a PNG file with matplotlib, where VTK cannot render.

Cells and lines are painted together from the back to the front, so that hidden parts are painted over; markers behind a cell are
left out.
"""

from __future__ import annotations

import numpy as np

from ..records import Bool, Float
from .scene import Panel, Scene

__all__ = ["draw"]

FRONT = 0.02
"""How far lines are drawn in front of where they are, over the extent of the picture."""


def draw(scene: Scene, path: str) -> None:
    """Draw the panels beside each other (wide ones below each other).

    Parameters
    ----------
    scene : Scene
    path : str
        PNG file.

    Raises
    ------
    ImportError
        Without matplotlib.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    extent = scene.extent[1] - scene.extent[0]
    stacked = extent[0] > 1.8 * extent[1]
    n = len(scene.panels)
    side = 6.0 * np.maximum(extent / extent.max(), 0.15) + np.array([0.3, 0.5])
    figure = Figure(figsize=(side[0], side[1] * n) if stacked else (side[0] * n, side[1]), layout="constrained")
    FigureCanvasAgg(figure)
    axes = np.atleast_1d(figure.subplots(n, 1) if stacked else figure.subplots(1, n))
    for ax, panel in zip(axes, scene.panels, strict=True):
        corners = panel.points[panel.cells]
        shapes, depth = list(corners[:, :, :2]), [corners[:, :, 2].mean(axis=1)]
        colours, widths = [panel.colours / 255], [np.full(len(corners), 0.2)]
        for rank, lines in enumerate(panel.lines):
            shapes += list(lines.segments[:, :, :2])
            depth.append(lines.segments[:, :, 2].mean(axis=1) + (rank + 1) * FRONT * extent.max())
            colours.append(np.tile(np.array(lines.colour) / 255, (len(lines.segments), 1)))
            widths.append(np.full(len(lines.segments), lines.width))
        order = np.argsort(np.concatenate(depth), kind="stable")
        paint = np.concatenate(colours)[order]
        pieces = [shapes[i] for i in order.tolist()]
        ax.add_collection(
            PolyCollection(pieces, facecolors=paint, edgecolors=paint, linewidths=np.concatenate(widths)[order], closed=False)
        )
        for markers in panel.markers:
            colour = tuple(c / 255 for c in markers.colour)
            x, y = markers.points[_in_front(panel, markers.points, 3 * FRONT * float(extent.max()))][:, :2].T
            ax.scatter(x, y, s=markers.size**2, color=[colour], marker="s" if markers.square else "o", zorder=3)
        ax.set_title(panel.title, fontsize=9)
        pad = 0.02 * extent.max()
        ax.set_xlim(scene.extent[0, 0] - pad, scene.extent[1, 0] + pad)
        ax.set_ylim(scene.extent[0, 1] - pad, scene.extent[1, 1] + pad)
        ax.set_aspect("equal")
        ax.set_axis_off()
    figure.savefig(path, dpi=130, format="png")


def _in_front(panel: Panel, points: Float, gap: float) -> Bool:
    """(k,) points (k, 3) that have no cell farther than `gap` in front of them."""
    cells = panel.cells if panel.cells.shape[1] == 3 else np.concatenate([panel.cells[:, :3], panel.cells[:, [0, 2, 3]]])
    a, b, c = panel.points[cells].transpose(1, 0, 2)
    out = np.ones(len(points), bool)
    area = _cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):  # cells that are seen edge on hide nothing
        for i, p in enumerate(points):
            v, w = _cross(p - a, c - a) / area, _cross(b - a, p - a) / area
            inside = (v >= 0) & (w >= 0) & (v + w <= 1)
            out[i] = not np.any(inside & ((1 - v - w) * a[:, 2] + v * b[:, 2] + w * c[:, 2] > p[2] + gap))
    return out


def _cross(u: Float, v: Float) -> Float:
    """Third coordinate of the cross product."""
    out: Float = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return out
