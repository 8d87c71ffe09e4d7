"""The default: the smooth boundary-aligned field that the library makes itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames
    from ..records import CrossField, Float

__all__ = ["Smooth"]


@dataclass(frozen=True)
class Smooth:
    """The minimiser of the Ginzburg–Landau energy.

    Parameters
    ----------
    epsilon : float, optional
        Core size of the energy in the user's units; by default the field is found by diffusion, without one.

    Raises
    ------
    InputError
        For an epsilon that is not positive and finite.
    """

    epsilon: float | None = None

    def __post_init__(self) -> None:
        if self.epsilon is not None and not (math.isfinite(self.epsilon) and self.epsilon > 0.0):
            raise InputError(f"epsilon is {self.epsilon:g}", remedy="give a positive length")

    def points(self) -> Float:
        """None."""
        return np.zeros((0, 3))

    def on(self, frames: EdgeFrames) -> CrossField | None:
        """None: the library makes the field."""
        del frames
        return None
