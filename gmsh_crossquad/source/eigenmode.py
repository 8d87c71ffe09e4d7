"""A cross field from an eigenfunction of the Laplacian: the quarter angle of its gradient.

The cross has a quarter of the angle of the gradient (against the projected x axis): its fourth power has the direction of the
gradient, and a zero of the gradient of index n (an extremum +1, a saddle -1) is a singularity of n / 4.  The lines of equal value
instead of the gradient turn all crosses by pi / 8.

The mode is that of quadratic finite elements (K f = lambda M f, shift-invert Lanczos from a fixed start vector): their gradient
at edge midpoints, the mean over the two triangles, is of second order, where that of linear elements, even recovered from
patches, was of first order.  On the boundary its normal (Dirichlet) or tangential part (Neumann) is taken.  Each component of a
face that embedded curves cut into parts has its own mode.  Modes are numbered from 1 by eigenvalue; the constant of the Neumann
problem does not count.

Symmetric domains have modes of equal eigenvalue, any combination of which is a mode.  Finite elements move the members of such a
group apart, relatively by up to 0.0015 (eigenvalue x area / number of nodes)^2, measured on discs and squares; twice that is
taken.  The modes of a group are chosen by how much of their square is near the ray from the centroid along the x axis: first the
one with most.  On a disc that makes J_n cos(n phi) first, J_n sin(n phi) second.  The sign is such that the mean is positive, or
if it is zero the moment in x, or in y.

On a curved face the operator is that of Laplace and Beltrami, and angles are measured from its frame (`frame`), the smoothest
directions without zeros, which on a plane is the x axis.  A closed face other than a torus has no frame: there the cross has the
angle of the gradient itself, and a zero of index n is a singularity of index n.

Measured against the exact modes 1 to 12 of the disc and of a 1.7 x 1 rectangle, at 400 and 4,200 (235 and 2,300) vertices: the
singularities are those of the exact mode, each within an edge length.  A zero of index -2 (J_3) becomes two of -1, after pairs of
opposite index at neighbouring vertices have been cancelled.  Modes whose gradient vanishes along a curve inside (J_0, or a cosine
of one coordinate) are refused.  4 s for 47,000 triangles, 1 s of it for the factors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from ..errors import FieldError, InputError
from ..records import Bool, CrossField, Float

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames
    from ..field.surface_mesh import SurfaceMesh
    from .elements import QuadraticElements

__all__ = ["Eigenmode"]

Boundary = Literal["dirichlet", "neumann"]
Lines = Literal["gradient", "isolines"]

#: relative distance of eigenvalues that are taken as equal, over (eigenvalue x area / number of nodes)^2
_EQUAL = 0.003
#: modes beyond the wanted one that may belong to the same group
_BEYOND = 6
#: least number of free nodes per mode
_PER_MODE = 40
#: a gradient that is weaker than this part of a neighbour's has no direction
_WEAK = 0.05
#: half width of the ray that tells equal modes apart, over the root of the area
_RAY = 0.05
#: a moment below this part of its greatest possible value is taken as zero
_NO_MOMENT = 0.01


@dataclass(frozen=True)
class Eigenmode:
    """The field of the k-th eigenfunction of the Laplacian on each face.

    Parameters
    ----------
    number : int
        From 1.
    boundary : {"dirichlet", "neumann"}
        Zero value, or zero normal derivative.
    lines : {"gradient", "isolines"}

    Raises
    ------
    InputError
        For another value.
    """

    number: int
    boundary: Boundary = "dirichlet"
    lines: Lines = "gradient"

    def __post_init__(self) -> None:
        if isinstance(self.number, bool) or self.number != int(self.number) or self.number < 1:
            raise InputError(f"eigenmode {self.number!r}", remedy="modes are numbered 1, 2, ...")
        for value, allowed in ((self.boundary, get_args(Boundary)), (self.lines, get_args(Lines))):
            if value not in allowed:
                raise InputError(f"eigenmode of {value!r}", remedy="choose from " + ", ".join(allowed))

    def points(self) -> Float:
        """None: (0, 3)."""
        return np.zeros((0, 3))

    def on(self, frames: EdgeFrames) -> CrossField:
        """The field on a face.

        Raises
        ------
        FieldError
            For a mode that the background triangles cannot resolve, and for one whose gradient vanishes along a curve.
        """
        from ..field.smooth import from_angles
        from .checks import check_turns
        from .elements import QuadraticElements
        from .neighbours import cancel_neighbours
        from .plane import plane_of

        if frames.curved:
            return self._on_curved(frames)
        mesh = frames.surface
        plane = plane_of(frames, "an eigenmode")
        z = plane.complex(frames.points)
        points = np.stack([z.real, z.imag], axis=1) / np.abs(z).max()
        elements = QuadraticElements(mesh, points)
        gx, gy = elements.edge_gradients(self._values(elements, points, frames.face)).T
        gradient = gx + 1j * gy
        along = frames.x @ plane.axes[0] + 1j * (frames.x @ plane.axes[1])
        on = mesh.boundary_edge
        across = gradient[on] * np.conj(along[on])
        gradient[on] = along[on] * (1j * across.imag if self.boundary == "dirichlet" else across.real)
        turn = 0.0 if self.lines == "gradient" else np.pi / 2
        angle = 0.25 * (np.angle(gradient) + turn)
        remedy = "the gradient of this mode vanishes there: choose another one"
        field = check_turns(frames, from_angles(mesh, angle - np.angle(along)), _weak(mesh, np.abs(gradient)), remedy)
        return CrossField(field.theta, cancel_neighbours(mesh, field.rotation))

    def _on_curved(self, frames: EdgeFrames) -> CrossField:
        """The field on a curved face."""
        from ..field.smooth import from_angles, wrap
        from .checks import check_turns
        from .elements import QuadraticElements
        from .frame import frame_angles, has_frame
        from .neighbours import cancel_neighbours

        mesh = frames.surface
        places = mesh.points - mesh.points.mean(axis=0)
        size = float(np.linalg.norm(places, axis=1).max())
        elements = QuadraticElements(mesh, mesh.layout / size)
        gradient = elements.edge_slopes(self._values(elements, places / size, frames.face))
        on = mesh.boundary_edge
        gradient[on] = 1j * gradient[on].imag if self.boundary == "dirichlet" else gradient[on].real
        angle = np.angle(gradient)
        if has_frame(mesh):
            base = frame_angles(frames)
            turn = 0.0 if self.lines == "gradient" else np.pi / 2
            field = from_angles(mesh, base + 0.25 * (np.angle(gradient * np.exp(-1j * base)) + turn))
        else:
            step = angle[mesh.triangle_edges] + mesh.edge_direction
            step = np.roll(step, -1, axis=1) - step
            field = CrossField(wrap(angle), step - 2 * np.pi * np.rint(step / (2 * np.pi)))
        remedy = "the gradient of this mode vanishes there: choose another one"
        field = check_turns(frames, field, _weak(mesh, np.abs(gradient)), remedy)
        return CrossField(field.theta, cancel_neighbours(mesh, field.rotation))

    def _values(self, elements: QuadraticElements, points: Float, face: int) -> Float:
        """The mode at all nodes, component by component."""
        mesh = elements.mesh
        places = np.concatenate([points, points[mesh.edges].mean(axis=1)])
        label = np.concatenate([mesh.components, mesh.components[mesh.edges[:, 0]]])
        fixed = np.concatenate([mesh.boundary_vertex, mesh.boundary_edge]) & (self.boundary == "dirichlet")
        first = 0 if self.boundary == "dirichlet" else 1
        stiffness, mass = elements.stiffness(), elements.mass()
        out = np.zeros(elements.size)
        for component in range(len(mesh.component_euler)):
            free = np.flatnonzero((label == component) & ~fixed)
            most = len(free) // _PER_MODE
            if self.number > most:
                raise FieldError(
                    f"the background mesh is too coarse for eigenmode {self.number}",
                    entity=(2, face),
                    remedy=(f"take a mode up to {most}, or " if most else "") + "use a finer background mesh",
                )
            count = min(self.number + first + _BEYOND, len(free) - 1)
            own = mass[free][:, free]
            modes = _lowest(stiffness[free][:, free], own, count, shift=-0.1 * first)
            out[free] = _chosen(*modes, self.number - 1 + first, first, places[free], own)
        return out


def _weak(mesh: SurfaceMesh, size: Float) -> Bool:
    """(e,) edges inside where the gradient, of length `size` (e,), is weak beside that on the other edges of their triangles."""
    largest = np.zeros(len(size))
    for k in range(3):
        np.maximum.at(largest, mesh.triangle_edges[:, k], size[mesh.triangle_edges].max(axis=1))
    return ~mesh.boundary_edge & (size < _WEAK * largest)


def _lowest(stiffness: Any, mass: Any, count: int, shift: float) -> tuple[Float, Float]:
    """Lowest `count` eigenvalues, ascending, and their modes (n, count)."""
    import scipy.sparse.linalg as spl

    from ..field.operators import factor

    lu = factor((stiffness - shift * mass).tocsc())
    n = stiffness.shape[0]
    inverse = spl.LinearOperator((n, n), matvec=lu.solve, dtype=np.float64)
    start = np.cos(1.0 + np.arange(n, dtype=np.float64))  # no symmetry of the mesh makes it orthogonal to a mode
    values, modes = spl.eigsh(stiffness, k=count, M=mass, sigma=shift, OPinv=inverse, v0=start, which="LM", tol=1e-10)
    order = np.argsort(values)
    return values[order], modes[:, order]


def _chosen(values: Float, modes: Float, wanted: int, first: int, points: Float, mass: Any) -> Float:
    """Column `wanted` of the modes, after those of equal eigenvalue have been told apart; modes before `first` stay alone."""
    weight = np.asarray(mass.sum(axis=1)).ravel()
    equal = _EQUAL * values * (values * weight.sum() / len(weight)) ** 2
    a = b = wanted
    while a > first and values[a] - values[a - 1] < equal[a]:
        a -= 1
    while b + 1 < len(values) and values[b + 1] - values[b] < equal[b + 1]:
        b += 1
    group = modes[:, a : b + 1]
    x, *others = (points - np.average(points, axis=0, weights=weight)).T
    if a < b:
        beside = sum((y / _RAY) ** 2 for y in others)
        ray = weight * np.exp(-beside / weight.sum()) * (x > 0.0)
        group = group @ np.linalg.eigh(group.T @ (ray[:, None] * group))[1][:, ::-1]
    mode = group[:, wanted - a]
    for moment in (weight, weight * x, *(weight * y for y in others)):
        part = float(moment @ mode)
        if abs(part) > _NO_MOMENT * float(np.abs(moment) @ np.abs(mode)):
            return mode * np.sign(part)
    return mode * np.sign(mode[np.argmax(np.abs(mode))])
