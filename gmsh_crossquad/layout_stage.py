"""The stages that look at the whole model: glue, quantize, guide, smooth, fill."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .attempts import Attempt
from .cad.curve_places import CurvePlaces
from .cad.joined_surfaces import JoinedSurfaces, cad_surfaces
from .cad.put import vertex_points
from .cad.sizes import target_sizes
from .faces_stage import Faces
from .field.surface_mesh import surface_of
from .fill.filler import Filler
from .guide import GuideResult, coarse_divisions, smooth_guide
from .layout.arc_sizes import arc_sizes
from .layout.glue import glue
from .layout.separable import parts_of_arcs
from .options import MeshOptions
from .records import Float, Int, Model, QuadMesh, TMesh
from .watch import Watch

__all__ = ["Laid", "lay_out"]

GUIDE_QUADS = 700
PART_QUADS = 100  # at least, of every part of an assembly
BLOCKS = 12
CROWDED = 0.5
MANY_ARCS = 3_500
ARC_WORK = 3  # of an arc in the quantization of a shell, in smoothed quads


@dataclass(frozen=True)
class Laid:
    """A layout and what was made of it.

    Attributes
    ----------
    tmesh : TMesh
    coarse : (a,) int64
        Coarse divisions of the arcs.
    guide : GuideResult
    mesh : QuadMesh
    """

    tmesh: TMesh
    coarse: Int
    guide: GuideResult
    mesh: QuadMesh


def lay_out(
    model: Model, faces: Faces, options: MeshOptions, attempt: Attempt, watch: Watch, seen: set[tuple[object, ...]]
) -> Laid | None:
    """Layout, guide grid and final mesh from the faces' T-meshes; None if `seen` has the same layout.

    Parameters
    ----------
    model : Model
    faces : Faces
    options : MeshOptions
    attempt : Attempt
    watch : Watch
    seen : set
        What other attempts led to; it grows.

    Raises
    ------
    LayoutError, MeshError
    """
    which = attempt.background, attempt.rule, attempt.pinned, attempt.capped
    surfaces = cad_surfaces(model, faces.meshes)
    with watch.stage("sizes"):
        sizes = target_sizes(model, faces.meshes, options)
    with watch.stage("glue"):
        tmesh = glue(model, faces.meshes, faces.tmeshes)
        size, user_size = arc_sizes(model, tmesh, sizes)
    extent, guide_size, arcs = _parts(tmesh, np.array([surface_of(m).area.sum() for m in faces.meshes]))
    if surfaces.curved.any():
        watch.work += ARC_WORK * len(tmesh.length)
    with watch.stage("quantize"):
        block = np.maximum(options.block_size * user_size, extent * attempt.blocks / BLOCKS)
        # the program is much harder where most arcs are shorter than a block
        block = np.where(arcs > MANY_ARCS, np.maximum(0.25 * block, user_size), block)
        wanted = np.where(size < CROWDED * user_size, size, block)
        if _known((*which, "sizes", attempt.shift, wanted.tobytes()), seen):
            return None
        coarse = coarse_divisions(model, tmesh, wanted, attempt.shift)
        if _known((*which, "divisions", coarse.tobytes()), seen):
            return None
    evaluate = CurvePlaces.find(model, surfaces)
    filler = Filler(model, surfaces, evaluate, vertex_points(model))
    result = smooth_guide(tmesh, coarse, user_size, guide_size, filler, watch, attempt.capped)
    with watch.stage("fill"):
        mesh = filler.fill(result.guide, result.fine)
        if isinstance(surfaces, JoinedSurfaces):
            mesh = surfaces.owned(mesh)
        moved = [model.curves[c].tag for c, faces in enumerate(evaluate.faces) if faces]
        if moved:
            note = f"nodes of {len(moved)} curves that are off their faces were moved to these (curve {moved[0]} and others)"
            mesh = replace(
                mesh,
                notes=(
                    *mesh.notes,
                    note if len(moved) > 1 else f"nodes of curve {moved[0]}, which is off its faces, were moved to these",
                ),
            )
    return Laid(tmesh, coarse, result, mesh)


def _parts(tmesh: TMesh, area: Float) -> tuple[Float, Float, Int]:
    """For every arc, of the connected part of the model that it is in: a length, the guide edge, and the number of arcs.

    A part of an assembly gets the blocks that it has alone, and its share of the guide cells, but not too few.
    """
    part = parts_of_arcs(tmesh)
    in_part = np.zeros(len(area), np.int64)
    for patch, sides in enumerate(tmesh.patches):
        in_part[tmesh.patch_face[patch]] = part[sides[0][0][0]]
    own = np.bincount(in_part, area)
    quads = np.maximum(GUIDE_QUADS * (own / own.sum()), PART_QUADS)
    return np.sqrt(own)[part], np.sqrt(own / quads)[part], np.bincount(part)[part]


def _known(key: tuple[object, ...], seen: set[tuple[object, ...]]) -> bool:
    """Whether `seen` has the key, which it has afterwards."""
    known = key in seen
    seen.add(key)
    return known
