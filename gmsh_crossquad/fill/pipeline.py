"""The final mesh from the smoothed guide grid.

Curves first (exact CAD points, monotone spacing), then the inner guide edges (Hermite cubics), then all cells (Coons); what is
done where cells come out badly, `placed` says.

On a curved face what cubics and Coons' rule give is put on the surface: the nodes inside guide edges first, those inside cells,
which lie between them, afterwards.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import InputError, MeshError
from ..records import Float, Guide, Int, Model, QuadMesh
from ..surfaces import Surfaces
from .cells import Cells
from .numbering import guide_chords
from .placed import Placed

__all__ = ["Placed", "fill", "mesh_of", "placed", "poor_cells", "poor_of", "shown_divisions"]

SHOWN = 8  # divisions that show what any greater number would


def fill(
    model: Model,
    surfaces: Surfaces,
    guide: Guide,
    divisions: Int,
    evaluate: Callable[[int, Float], Float],
    vertices: Float | None = None,
    *,
    filler: str = "numpy",
) -> QuadMesh:
    """Divide a guide grid.

    Parameters
    ----------
    model : Model
    surfaces : Surfaces
        The faces of `model`.
    guide : Guide
    divisions : (c,) int64
        Pieces of the edges of every guide chord (`guide_chords`), at least 1.
    evaluate : callable (curve row, parameters (m,)) -> (m, 3)
        Exact points of a CAD curve, in the user's coordinates.
    vertices : (v, 3) float64, optional
        Exact CAD vertices in the user's coordinates; by default those of `model`.
    filler : {"numpy", "gmsh"}
        Who fills the cells.  Both follow the same rule; Gmsh's transfinite mesher takes longer, and fills
        plane faces only.

    Returns
    -------
    QuadMesh
        Quads are ordered by face and guide quad; nodes by CAD vertex, curve and face.

    Raises
    ------
    MeshError
        A guide quad that is not inverted cannot be filled without inverted quads, or the guide is not conforming.
    InputError
        An unknown filler, or Gmsh for curved faces.
    """
    if filler not in ("numpy", "gmsh"):
        raise InputError(f"unknown filler {filler!r}", remedy='use "numpy" or "gmsh"')
    if filler == "gmsh" and surfaces.curved.any():
        raise InputError("Gmsh's filler cannot fill curved faces", remedy='use "numpy"')
    return mesh_of(placed(model, surfaces, guide, divisions, evaluate, vertices), filler)


def mesh_of(work: Placed, filler: str = "numpy") -> QuadMesh:
    """The mesh of placed nodes; see `fill`."""
    model, cells, points, own = work.model, work.cells, work.points, work.own
    guide = cells.guide
    _refuse_folds(model, guide, own, work.worst)
    if filler == "gmsh":
        from .gmsh_fill import gmsh_cells

        for q, inside in enumerate(gmsh_cells(guide.quads, cells.topology, cells.skeleton)):
            first = cells.numbering.cell_first[q]
            points[first : first + len(inside)] = inside * model.scale + model.origin
    return _record(guide, cells, points, tuple(work.parameters), int(np.count_nonzero(own <= 0)))


def poor_cells(
    model: Model,
    surfaces: Surfaces,
    guide: Guide,
    divisions: Int,
    evaluate: Callable[[int, Float], Float],
    vertices: Float | None = None,
) -> tuple[Int, Int]:
    """Guide quads that come out of `fill` worse than they should: divide their chords and smooth the guide again.

    Parameters
    ----------
    model, surfaces, guide, divisions, evaluate, vertices
        As for `fill`; of more than `SHOWN` divisions the cells are judged at that many, and of one at two, so that an edge
        that cuts across a curve is seen; prescribed nodes are kept.

    Returns
    -------
    poor : (k,) int64
        Rows of ``guide.quads`` with a fine quad worse than half of the guide quad's own scaled Jacobian, although their
        inner edges were straightened; in a cusp those with an inverted one.
    folded : (l,) int64
        Those of them that have an inverted fine quad.
    """
    return poor_of(placed(model, surfaces, guide, shown_divisions(model, guide, divisions), evaluate, vertices))


def poor_of(work: Placed) -> tuple[Int, Int]:
    """The poor and the folded ones of placed cells; see `poor_cells`."""
    return np.flatnonzero(work.worst < work.wanted(work.own)), np.flatnonzero(work.worst <= 0)


def shown_divisions(model: Model, guide: Guide, divisions: Int) -> Int:
    """The divisions (c,) of guide chords at which `poor_cells` judges."""
    shown = np.clip(divisions, 2, SHOWN)
    if all(curve.spacing is None for curve in model.curves):
        return shown
    edges, _, chord, _ = guide_chords(guide.quads)
    n = len(guide.points)
    for curve, chain in zip(model.curves, guide.chains):
        if curve.spacing is not None:
            along = np.minimum(chain[:-1], chain[1:]) * n + np.maximum(chain[:-1], chain[1:])
            own_chords = chord[np.searchsorted(edges[:, 0] * n + edges[:, 1], along)]
            shown[own_chords] = divisions[own_chords]
    return shown


def placed(
    model: Model,
    surfaces: Surfaces,
    guide: Guide,
    divisions: Int,
    evaluate: Callable[[int, Float], Float],
    vertices: Float | None = None,
) -> Placed:
    """All nodes of the mesh in their places; arguments as for `fill`."""
    work = Placed.start(model, surfaces, guide, divisions, evaluate, vertices)
    work.worst[:] = work.place(work.own)
    return work


def _refuse_folds(model: Model, guide: Guide, own: Float, worst: Float) -> None:
    """Raise where fine quads are inverted although their guide quad is not."""
    folded = np.flatnonzero((worst <= 0) & (own > 0))
    if len(folded):
        q = folded[np.argmin(worst[folded])]
        raise MeshError(
            f"{len(folded)} cells fold when they are filled",
            entity=(2, model.faces[guide.quad_face[q]].tag),
            location=guide.points[guide.quads[q]].mean(axis=0) * model.scale + model.origin,
            remedy="use a smaller size",
        )


def _record(guide: Guide, cells: Cells, points: Float, parameters: tuple[Float, ...], inverted: int) -> QuadMesh:
    """Put the parts of the mesh together."""
    numbering, order = cells.numbering, cells.numbering.cell_order
    count = cells.divisions.prod(axis=1)[order]
    notes = (f"{inverted} inverted guide quads were filled as they are",) if inverted else ()
    return QuadMesh(
        points,
        cells.quads(),
        np.repeat(guide.quad_face[order], count),
        np.repeat(guide.quad_block[order], count),
        numbering.vertex_node,
        numbering.curve_nodes,
        parameters,
        numbering.face_nodes,
        notes,
    )
