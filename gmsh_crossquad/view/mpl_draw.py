"""Drawing a `Scene` into a PNG file with matplotlib, where VTK cannot render; hidden parts are painted over."""

from __future__ import annotations

import numpy as np

from .scene import Scene

__all__ = ["draw"]


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
    from matplotlib.collections import LineCollection, PolyCollection
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
        order = np.argsort(corners[:, :, 2].mean(axis=1), kind="stable")
        fill = panel.colours[order] / 255
        ax.add_collection(PolyCollection(list(corners[order][:, :, :2]), facecolors=fill, edgecolors=fill, linewidths=0.2))
        for lines in panel.lines:
            colour = tuple(c / 255 for c in lines.colour)
            ax.add_collection(LineCollection(list(lines.segments[:, :, :2]), colors=[colour], linewidths=lines.width))
        for markers in panel.markers:
            colour = tuple(c / 255 for c in markers.colour)
            x, y = markers.points[:, :2].T
            ax.scatter(x, y, s=markers.size**2, color=[colour], marker="s" if markers.square else "o", zorder=3)
        ax.set_title(panel.title, fontsize=9)
        pad = 0.02 * extent.max()
        ax.set_xlim(scene.extent[0, 0] - pad, scene.extent[1, 0] + pad)
        ax.set_ylim(scene.extent[0, 1] - pad, scene.extent[1, 1] + pad)
        ax.set_aspect("equal")
        ax.set_axis_off()
    figure.savefig(path, dpi=130, format="png")
