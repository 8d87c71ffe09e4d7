"""A face whose layout has no integer divisions: look at it alone, and try other fields until it has.

First those of `field.repair`, which change the flux around holes, then pairs of singularities where the layout misses divisions
(`together`), which also help where there are no holes, as on a torus.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import LayoutError
from ..field.repair import alternatives
from ..field.surface_mesh import surface_of
from ..records import AlignedField, FaceMesh, FaceTMesh, Int, Model
from .face_tmesh import trace_face
from .glue import glue
from .quantize import quantize
from .together import divisible_together

__all__ = ["divisible", "has_divisions"]


def has_divisions(model: Model, mesh: FaceMesh, tmesh: FaceTMesh) -> bool:
    """Whether the layout of one face, without its neighbours, has integer divisions.

    Parameters
    ----------
    model : Model
    mesh, tmesh
        Of the same face.
    """
    alone = replace(model, faces=(model.faces[mesh.face],))
    single = glue(alone, [mesh], [tmesh])
    try:
        # lengths do not matter for this; few divisions make it fast
        quantize(alone, single, np.maximum(single.length / (0.25 * single.length.max()), 0.5))
    except LayoutError:
        return False
    return True


def divisible(
    model: Model, mesh: FaceMesh, aligned: AlignedField, tmesh: FaceTMesh, held: Int, *, move: bool = True
) -> tuple[AlignedField, FaceTMesh]:
    """A field like `aligned` whose layout has integer divisions, and that layout; the given ones if they have.

    Parameters
    ----------
    model : Model
    mesh, aligned, tmesh
        Of the same face.
    held : (k,) int64
        Singular vertices that must not move.
    move : bool
        As for `field.repair.alternatives`.

    Raises
    ------
    LayoutError
        If nothing that was tried has divisions; its location is in the face's coordinates.
    """
    if has_divisions(model, mesh, tmesh):
        return aligned, tmesh
    for other in alternatives(mesh, aligned, held, move=move):
        try:
            found = trace_face(mesh, other)
        except LayoutError:
            continue
        if has_divisions(model, mesh, found):
            return other, found
    alone = replace(model, faces=(model.faces[mesh.face],))
    try:
        paired = divisible_together(alone, [mesh], [aligned], [tmesh])
    except LayoutError:
        paired = None
    if paired is not None:
        return paired.fields[0], paired.tmeshes[0]
    loops = surface_of(mesh).loops
    worst = int(np.argmax(np.abs(aligned.flux))) if loops else -1
    around = f" (flux {aligned.flux[worst]:.3g} around a boundary loop)" if loops else ""
    raise LayoutError(
        f"no layout of the cross field has integer divisions{around}",
        entity=(2, model.faces[mesh.face].tag),
        location=mesh.points[loops[worst][0] if loops else 0],
        remedy="change the singularities or boundary indices",
    )
