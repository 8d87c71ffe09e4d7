"""Drawing a `Scene` into a PNG file with VTK.

Off-screen rendering needs EGL or OSMesa; without it VTK brings the whole process down.  So this module is run as a process of
its own, ``python -m gmsh_crossquad.view.vtk_draw FILE``, with the pickled scene as its standard input: if that fails, the
caller draws in another way.
"""

from __future__ import annotations

import pickle
import sys

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkTextActor,
    vtkWindowToImageFilter,
)

try:  # both register their implementations on import
    import vtkmodules.vtkRenderingFreeType
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
except ImportError as error:
    raise SystemExit(f"VTK is not complete: {error}") from None

from ..records import Float, Int
from .scene import Lines, Markers, Panel, Scene

__all__ = ["draw"]

LONG = 760
"""Pixels along the longer side of a panel."""
MARGIN, CAPTION = 26, 46


def _cells(cells: Int) -> vtkCellArray:
    out = vtkCellArray()
    n, width = cells.shape
    offsets = numpy_to_vtkIdTypeArray(np.arange(n + 1, dtype=np.int64) * width, deep=True)
    out.SetData(offsets, numpy_to_vtkIdTypeArray(np.ascontiguousarray(cells, np.int64).ravel(), deep=True))
    return out


def _data(points: Float) -> vtkPolyData:
    data, holder = vtkPolyData(), vtkPoints()
    holder.SetData(numpy_to_vtk(np.ascontiguousarray(points, np.float64), deep=True))
    data.SetPoints(holder)
    return data


def _actor(data: vtkPolyData, lift: float) -> vtkActor:
    mapper, actor = vtkPolyDataMapper(), vtkActor()
    mapper.SetInputData(data)
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(1.0, 2.0)
    mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-1.0, -lift)
    mapper.SetRelativeCoincidentTopologyPointOffsetParameter(-lift)
    actor.SetMapper(mapper)
    actor.GetProperty().LightingOff()
    return actor


def _fill(panel: Panel) -> vtkActor:
    data = _data(panel.points)
    data.SetPolys(_cells(panel.cells))
    data.GetCellData().SetScalars(numpy_to_vtk(np.ascontiguousarray(panel.colours, np.uint8), deep=True))
    return _actor(data, 0.0)


def _lines(lines: Lines, lift: float) -> vtkActor:
    data = _data(lines.segments.reshape(-1, 3))
    data.SetLines(_cells(np.arange(2 * len(lines.segments)).reshape(-1, 2)))
    actor = _actor(data, lift)
    actor.GetProperty().SetColor(*(c / 255 for c in lines.colour))
    actor.GetProperty().SetLineWidth(1.5 * lines.width)
    return actor


def _markers(markers: Markers, lift: float) -> vtkActor:
    data = _data(markers.points)
    data.SetVerts(_cells(np.arange(len(markers.points))[:, None]))
    actor = _actor(data, lift)
    actor.GetProperty().SetColor(*(c / 255 for c in markers.colour))
    actor.GetProperty().SetPointSize(1.6 * markers.size)
    actor.GetProperty().SetRenderPointsAsSpheres(not markers.square)
    return actor


def draw(scene: Scene, path: str) -> None:
    """Draw the panels beside each other (wide ones below each other).

    Parameters
    ----------
    scene : Scene
    path : str
        PNG file.
    """
    extent = scene.extent[1] - scene.extent[0]
    scale = LONG / float(extent.max())
    size = np.maximum(extent * scale, 0.15 * LONG) + 2 * MARGIN + np.array([0, CAPTION])
    size[0] = max(size[0], 560)  # room for the caption
    stacked = extent[0] > 1.8 * extent[1]
    n = len(scene.panels)
    across, down = (1, n) if stacked else (n, 1)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(int(size[0]) * across, int(size[1]) * down)
    for k, panel in enumerate(scene.panels):
        x, y = (0, n - 1 - k) if stacked else (k, 0)
        renderer = vtkRenderer()
        renderer.SetViewport(x / across, y / down, (x + 1) / across, (y + 1) / down)
        renderer.SetBackground(1, 1, 1)
        renderer.AddActor(_fill(panel))
        for i, lines in enumerate(panel.lines):
            renderer.AddActor(_lines(lines, 4.0 * (i + 1)))
        for markers in panel.markers:
            renderer.AddActor(_markers(markers, 40.0))
        caption = vtkTextActor()
        caption.SetInput(panel.title)
        style = caption.GetTextProperty()
        style.SetFontSize(19)
        style.SetColor(0.12, 0.13, 0.16)
        style.SetJustificationToCentered()
        caption.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
        caption.SetPosition(0.5, 14 / int(size[1]))
        renderer.AddViewProp(caption)
        camera = renderer.GetActiveCamera()
        middle = scene.extent.mean(axis=0)
        depth = float(np.abs(panel.points[:, 2]).max(initial=0.0)) + float(extent.max())
        shift = 0.5 * CAPTION / scale
        camera.SetFocalPoint(middle[0], middle[1] - shift, 0.0)
        camera.SetPosition(middle[0], middle[1] - shift, 2 * depth)
        camera.SetViewUp(0, 1, 0)
        camera.ParallelProjectionOn()
        camera.SetParallelScale(0.5 * size[1] / scale)
        renderer.ResetCameraClippingRange()
        window.AddRenderer(renderer)
    window.Render()
    grab, writer = vtkWindowToImageFilter(), vtkPNGWriter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.Update()
    writer.SetFileName(path)
    writer.SetInputData(grab.GetOutput())
    writer.Write()


if __name__ == "__main__":
    draw(pickle.load(sys.stdin.buffer), sys.argv[1])
