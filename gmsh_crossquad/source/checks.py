"""Cross fields at edge midpoints that come from outside: repair of single gaps, and refusal of what cannot be trusted.

A place is undefined where the user's field is zero, or normal to the face, or isotropic.  A single one is repaired: it takes the
mean of the crosses on the other edges of its triangles (in the 4-symmetric power representation).  So is one on the
boundary, where the field is turned into the boundary's direction anyway.  Neighbours inside that are undefined together are a
curve or a region without a field, and an error.

Between two neighbouring edges a cross turns by at most 45 degrees; a turn near 45 degrees may be taken for one the other way
round, which makes a singularity.  Near a singularity a few such turns are normal.  They are an error

- if more than a fifth of the triangles turn by more than 36 degrees between two of their edges (in a random field one half do,
  in a resolved one only those around singularities): the triangles are too coarse for the field;
- if more than 8 triangles that hang together turn by more than 40.5 degrees: there the field jumps along a curve, like a quarter
  of the angle of a gradient that vanishes along it.  (Measured: up to 4 for the first 15 eigenmodes of a disc and a rectangle at
  several sizes, 10 to 200 for those whose gradient vanishes along a curve.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import FieldError
from ..records import Bool, CrossField, Float, Int

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames

__all__ = ["COARSE_SHARE", "COARSE_TURN", "JUMP_TURN", "LONGEST_JUMP", "check_turns", "fill_gaps", "largest_cluster"]

COARSE_TURN = 0.8 * np.pi / 4
COARSE_SHARE = 0.2
JUMP_TURN = 0.9 * np.pi / 4
LONGEST_JUMP = 8
_REMEDY = "give a smoother field, or use a finer background mesh"


def fill_gaps(frames: EdgeFrames, theta: Float, defined: Bool) -> Float:
    """Angles `theta` (e,) from the edges, with those that are not `defined` (e,) filled from their neighbours.

    Raises
    ------
    FieldError
        If none is defined, or if neighbours inside the face are undefined together.
    """
    if np.all(defined):
        return theta
    mesh = frames.surface
    if not np.any(defined):
        raise FieldError("the field is undefined everywhere", entity=(2, frames.face), remedy="it is zero or normal to the face")
    here = defined[mesh.triangle_edges]
    inside = ~here & ~mesh.boundary_edge[mesh.triangle_edges]
    bad = (inside.sum(axis=1) > 1) | (inside.any(axis=1) & (here.sum(axis=1) < 2))
    angle = theta[mesh.triangle_edges] + mesh.edge_direction
    power = np.where(here, np.exp(4j * angle), 0.0).sum(axis=1)
    total = np.zeros(len(theta), np.complex128)
    for k in range(3):
        np.add.at(total, mesh.triangle_edges[:, k], power * np.exp(-4j * mesh.edge_direction[:, k]))
    lost = ~defined & (np.abs(total) < 1e-9)
    if np.any(bad) or np.any(lost):
        edge = mesh.triangle_edges[bad][~here[bad]][0] if np.any(bad) else np.flatnonzero(lost)[0]
        raise FieldError(
            "the field is undefined (zero, normal to the face or isotropic) along a curve or in a region",
            entity=(2, frames.face),
            location=frames.places[edge],
            remedy="give it a direction there",
        )
    return np.where(defined, theta, 0.25 * np.angle(total))


def check_turns(frames: EdgeFrames, field: CrossField, weak: Bool | None = None, remedy: str = _REMEDY) -> CrossField:
    """The field itself.

    Parameters
    ----------
    frames : EdgeFrames
    field : CrossField
    weak : (e,) bool, optional
        Places where the direction is not to be trusted; their triangles count as jumps.
    remedy : str
        For a field that jumps.

    Raises
    ------
    FieldError
        If the background is too coarse for it, or if it jumps along a curve.
    """
    turn = np.abs(field.rotation).max(axis=1)
    coarse = turn > COARSE_TURN
    if coarse.mean() > COARSE_SHARE:
        raise FieldError(
            f"the field turns by more than 36 degrees within {100 * coarse.mean():.0f} % of the background triangles",
            entity=(2, frames.face),
            location=_middle(frames, coarse).tolist(),
            remedy=_REMEDY,
        )
    jumps = turn > JUMP_TURN
    if weak is not None:
        jumps |= weak[frames.surface.triangle_edges].any(axis=1)
    jump = largest_cluster(frames.surface.triangles, jumps)
    if jump.sum() > LONGEST_JUMP:
        raise FieldError(
            "the field jumps by 45 degrees along a curve",
            entity=(2, frames.face),
            location=_middle(frames, jump).tolist(),
            remedy=remedy,
        )
    return field


def _middle(frames: EdgeFrames, triangles: Bool) -> Float:
    """Centroid of the first of the triangles."""
    return frames.points[frames.surface.triangles[np.flatnonzero(triangles)[0]]].mean(axis=0)


def largest_cluster(triangles: Int, wanted: Bool) -> Bool:
    """(m,) the largest set of wanted triangles (rows of `triangles` (m, 3)) that hang together by vertices."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    row = np.flatnonzero(wanted)
    vertex = triangles[row]
    n = len(wanted)
    size = n + int(triangles.max()) + 1
    links = coo_matrix((np.ones(vertex.size), (np.repeat(row, 3), n + vertex.ravel())), (size, size))
    label = connected_components(links, directed=False)[1][:n]
    return wanted & (label == int(np.argmax(np.bincount(label[wanted], minlength=1))))
