"""The values of a sampled field: shapes, and which are usable."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ..errors import FieldError
from ..records import Float

__all__ = ["KINDS", "Kind", "checked_values"]

Kind = Literal["direction", "directions", "angle", "tensor"]
KINDS: tuple[str, ...] = get_args(Kind)

_SHAPES = {
    "direction": "(n, 2) or (n, 3)",
    "directions": "(n, 2, 2) or (n, 2, 3)",
    "angle": "(n,)",
    "tensor": "(n, 3), (n, 4), (n, 6), (n, 9), (n, 2, 2) or (n, 3, 3)",
}


def checked_values(values: object, kind: str, count: int) -> Float:
    """Values in one of the forms (n,) angles, (n, a, 3) directions, (n, 3, 3) symmetric tensors.

    Parameters
    ----------
    values : array_like
        One direction (n, 2|3); two (n, 2, 2|3), (n, 4) or (n, 6); angles (n,) or (n, 1); tensors (n, 3) as xx, yy, xy,
        (n, 6) as xx, yy, zz, xy, yz, xz, (n, 4), (n, 9), (n, 2, 2) or (n, 3, 3) by rows.
    kind : {"direction", "directions", "angle", "tensor"}
    count : int
        Wanted n.

    Raises
    ------
    FieldError
        For another kind, a wrong shape, values that are no numbers and tensors that are not symmetric.
    """
    if kind not in KINDS:
        raise FieldError(f"a field of kind {kind!r}", remedy="the kinds are " + ", ".join(KINDS))
    try:
        v = np.asarray(values)
        if np.iscomplexobj(v):
            raise TypeError
        v = v.astype(np.float64)
    except (TypeError, ValueError):
        raise FieldError("the values of the field are no real numbers", remedy=f"give an array {_SHAPES[kind]}") from None
    if v.ndim == 0 or len(v) != count:
        raise FieldError(
            f"the field has values of shape {v.shape} for {count} places",
            remedy=f"give an array {_SHAPES[kind]} with n = {count}",
        )
    out = {"direction": _direction, "directions": _directions, "angle": _angle, "tensor": _tensor}[kind](v)
    if out is None:
        raise FieldError(
            f"the field has values of shape {v.shape}", remedy=f"an array {_SHAPES[kind]} is needed for kind {kind!r}"
        )
    return out


def _direction(v: Float) -> Float | None:
    return _padded(v[:, None, :]) if v.ndim == 2 and v.shape[1] in (2, 3) else None


def _directions(v: Float) -> Float | None:
    if v.ndim == 2 and v.shape[1] in (4, 6):
        v = v.reshape(len(v), 2, -1)
    return _padded(v) if v.ndim == 3 and v.shape[1] == 2 and v.shape[2] in (2, 3) else None


def _padded(v: Float) -> Float:
    return v if v.shape[2] == 3 else np.concatenate([v, np.zeros((*v.shape[:2], 1))], axis=2)


def _angle(v: Float) -> Float | None:
    if v.ndim == 2 and v.shape[1] == 1:
        v = v[:, 0]
    return v if v.ndim == 1 else None


def _tensor(v: Float) -> Float | None:
    n = len(v)
    if v.ndim == 2 and v.shape[1] in (4, 9):
        side = 2 if v.shape[1] == 4 else 3
        v = v.reshape(n, side, side)
    if v.ndim == 3 and v.shape[1:] in ((2, 2), (3, 3)):
        out = np.zeros((n, 3, 3))
        out[:, : v.shape[1], : v.shape[1]] = v
    elif v.ndim == 2 and v.shape[1] in (3, 6):
        places = ((0, 0), (1, 1), (0, 1)) if v.shape[1] == 3 else ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
        out = np.zeros((n, 3, 3))
        for column, (i, j) in enumerate(places):
            out[:, i, j] = out[:, j, i] = v[:, column]
    else:
        return None
    skew = np.abs(out - out.transpose(0, 2, 1))
    if np.any(np.isfinite(skew)) and np.nanmax(skew) > 1e-6 * np.nanmax(np.abs(out)):
        raise FieldError("a tensor of the field is not symmetric", remedy="give its symmetric part")
    return out
