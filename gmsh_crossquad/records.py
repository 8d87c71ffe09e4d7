"""The frozen records that the stages hand to each other, in the order of the pipeline.

    Model -> FaceMesh -> CrossField -> AlignedField -> FaceTMesh -> TMesh -> Quotient -> Guide -> QuadMesh

All geometry up to `Guide` is in *scaled* coordinates, ``(x - model.origin) / model.scale``, in which the model's
bounding box has diagonal 1.  Arrays are rows-first; angles are radians; an index is an integer count of quarter turns.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

__all__ = [
    "AlignedField",
    "CrossField",
    "Curve",
    "Face",
    "FaceMesh",
    "FaceTMesh",
    "Float",
    "Guide",
    "Int",
    "Model",
    "Parts",
    "QuadMesh",
    "TMesh",
]

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Curve:
    """A CAD curve, sampled densely enough to stand for it.

    Attributes
    ----------
    tag : int
        Gmsh tag.
    start, end : int
        Rows of `Model.vertices`; equal for a closed curve.  A closed curve without a CAD vertex gets one there.
    points : (n, 3) float64, scaled
        From start to end; both end points included, for a closed curve the first is repeated at the end.
    parameters : (n,) float64
        CAD parameter of every sample (monotone).
    arclength : (n,) float64, scaled
        Cumulative length of the polyline; first 0, last the curve's length.
    spacing : (d + 1,) float64 or None
        Arc lengths of the nodes that a Transfinite Curve command prescribes (0 and the length included), else None.
    tangents : (2, 3) float64 or None
        Unit directions from the CAD in which the curve leaves its start and its end, both pointing into the curve;
        None: those of the samples.
    """

    tag: int
    start: int
    end: int
    points: Float
    parameters: Float
    arclength: Float
    spacing: Float | None = None
    tangents: Float | None = None

    @property
    def closed(self) -> bool:
        return self.start == self.end

    @property
    def length(self) -> float:
        return float(self.arclength[-1])

    def at(self, s: Float) -> Float:
        """Points (k, 3) at arc lengths `s` (k,); periodic on a closed curve, clamped on an open one."""
        s = np.asarray(s, float)
        s = np.mod(s, self.length) if self.closed else s
        return np.stack([np.interp(s, self.arclength, self.points[:, c]) for c in range(3)], axis=-1)


@dataclass(frozen=True)
class Face:
    """A CAD face, plane or curved.

    Local coordinates ``(x - origin) @ axes.T`` of a plane face are those in its plane; of a curved one they are the scaled
    coordinates themselves.

    Attributes
    ----------
    tag : int
    origin : (3,) float64, scaled; axes : (2, 3) or (3, 3) float64
        Of a plane face an orthonormal frame; ``cross(axes[0], axes[1])`` is the CAD normal.  Of a curved one 0 and the
        identity.
    loops : tuple of loops, each a tuple of (curve row, +1 or -1)
        Of a plane face the outer loop first and counter-clockwise in the local frame, holes clockwise: the face is on the
        left.  Of a curved face in any order and direction; none where it is closed.
    embedded_curves : tuple of int
        Rows of `Model.curves` that lie inside the face (cracks, embedded lines).
    embedded_points : tuple of int
        Rows of `Model.vertices` inside the face that are on no curve of it.
    area, extent : float, scaled
        Of a curved face its area (by the built-in kernel an estimate) and the diagonal of its box; NaN on plane ones.
    parts : tuple of Face
        The CAD faces, without loops, of which the face is made where it is several that meet in smooth joints; none elsewhere.
    turned : bool
        Of a part, whether its CAD normal is opposite to that of the whole.
    """

    tag: int
    origin: Float
    axes: Float
    loops: tuple[tuple[tuple[int, int], ...], ...]
    embedded_curves: tuple[int, ...] = ()
    embedded_points: tuple[int, ...] = ()
    area: float = float("nan")
    extent: float = float("nan")
    parts: tuple[Face, ...] = ()
    turned: bool = False

    @property
    def curved(self) -> bool:
        """Whether the face is not known to be plane."""
        return len(self.axes) == 3

    @property
    def tags(self) -> tuple[int, ...]:
        """Gmsh tags of the CAD faces that the face is made of."""
        return tuple(part.tag for part in self.parts) or (self.tag,)

    @property
    def normal(self) -> Float:
        """Unit normal (3,) of a plane face."""
        assert not self.curved
        out: Float = np.cross(self.axes[0], self.axes[1])
        return out

    def local(self, points: Float) -> Float:
        """Local coordinates (n, 2) or (n, 3) of scaled points (n, 3)."""
        out: Float = (np.asarray(points) - self.origin) @ self.axes.T
        return out

    def world(self, points: Float) -> Float:
        """Scaled points (n, 3) of local coordinates (n, 2) or (n, 3)."""
        out: Float = self.origin + np.asarray(points) @ self.axes
        return out


@dataclass(frozen=True)
class Model:
    """What is needed of the CAD model.

    Attributes
    ----------
    name : str
        Gmsh model name.
    origin : (3,) float64; scale : float
        scaled = (x - origin) / scale.
    vertex_tags : (v,) int64
        Gmsh point tags of all CAD vertices of the wanted faces, and of embedded points; -1 where a closed curve
        without vertex got one.
    vertices : (v, 3) float64, scaled
    vertex_ports : (v,) bool
        True where the user asked for a block corner: vertices in a physical group, embedded points.
    curves : tuple of Curve
    faces : tuple of Face
        The faces to mesh: those in physical surfaces where there are any, else all.
    notes : tuple of str
        What the user should know (defects of the model that were mended).
    point_names : tuple of (int, str)
        Gmsh tag of every CAD point in a named physical group with the group's name, also of points of no wanted face.
    face_names : tuple of tuple of str
        Names of the physical surfaces that hold each face; empty where nobody has read them.
    face_groups : tuple of tuple of int
        Tags of the physical surfaces that hold every face, named or not.
    ignored_curves : tuple of int
        Gmsh tags of the curves that are left out because faces go on smoothly across them.
    vertex_twins : tuple of (int, int)
        Gmsh tags of CAD vertices that a curve without length joins to another one, with the row of that one.
    """

    name: str
    origin: Float
    scale: float
    vertex_tags: Int
    vertices: Float
    vertex_ports: Bool
    curves: tuple[Curve, ...]
    faces: tuple[Face, ...]
    notes: tuple[str, ...] = field(default=())
    point_names: tuple[tuple[int, str], ...] = ()
    face_names: tuple[tuple[str, ...], ...] = ()
    face_groups: tuple[tuple[int, ...], ...] = ()
    ignored_curves: tuple[int, ...] = ()
    vertex_twins: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class Parts:
    """The background triangles of a face that is made of several CAD faces, each by itself, and their joints.

    Attributes
    ----------
    points : tuple of (n, 3) float64, scaled
    triangles : tuple of (m, 3) int64
        Oriented as the CAD normal of the part.
    parameters : tuple of (n, 2) float64
        CAD parameters on that part.
    edges : tuple of (e, 2) int64
        For every part its edges on joints, in the direction of the curve.
    curve : tuple of (e,) int64
        Gmsh tags of these curves.
    at : tuple of (e, 2) float64
        Parameters on the curve of the ends of the edges.
    other : tuple of (e,) int64
        Row of the part on the other side.
    """

    points: tuple[Float, ...]
    triangles: tuple[Int, ...]
    parameters: tuple[Float, ...]
    edges: tuple[Int, ...]
    curve: tuple[Int, ...]
    at: tuple[Float, ...]
    other: tuple[Int, ...]


@dataclass(frozen=True)
class FaceMesh:
    """Background triangles of one face, cut open along embedded curves.

    Attributes
    ----------
    face : int
        Row of `Model.faces`.
    points : (n, 2) or (n, 3) float64
        Local coordinates of a plane or of a curved face.  A point on an embedded curve appears once per side.
    triangles : (m, 3) int64
        Counter-clockwise.
    boundary : (b, 2) int64
        All boundary half-edges (start, end), the face on the left.  Both sides of an embedded curve are boundary.
    boundary_curve : (b,) int64
        Row of `Model.curves`.
    boundary_arclength : (b, 2) float64
        Arc length on the curve at start and end of the half-edge (on a closed curve the end of the last
        half-edge is the length, not 0).
    vertex : (n,) int64
        Row of `Model.vertices` or -1.
    opening_angle : (n,) float64
        At boundary points that are CAD vertices the angle of this sector from CAD tangents, in (0, 2 pi]; NaN elsewhere.
    port : (n,) bool
        True where the layout must have a block corner although the field is regular there.
    seed : (n,) int64
        Row of the points that were asked to be vertices of the face, or -1; all -1 where it is left out.
    parameters : (n, 2) float64
        CAD parameters (u, v) of the points on a curved face, NaN where the CAD gives none; on a seam those of one side.
        Empty (0, 2) on plane faces.
    parts : Parts or None
        Of a face that is made of several, whose `parameters` are NaN.
    """

    face: int
    points: Float
    triangles: Int
    boundary: Int
    boundary_curve: Int
    boundary_arclength: Float
    vertex: Int
    opening_angle: Float
    port: Bool
    seed: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    parameters: Float = field(default_factory=lambda: np.zeros((0, 2)))
    parts: Parts | None = None

    def __post_init__(self) -> None:
        if not len(self.seed):
            object.__setattr__(self, "seed", np.full(len(self.points), -1))


@dataclass(frozen=True)
class CrossField:
    """A cross field in Crouzeix–Raviart form.

    Attributes
    ----------
    theta : (e,) float64
        Angle of the cross at every edge midpoint, from the edge's direction (lower to higher vertex), modulo pi/2.
    rotation : (m, 3) float64
        Real rotation of the cross from edge k to edge k + 1 of every triangle (counter-clockwise); all integers live here.
    """

    theta: Float
    rotation: Float


@dataclass(frozen=True)
class AlignedField:
    """A boundary-aligned cross field whose singularities are at vertices.

    Attributes
    ----------
    field : CrossField
    index : (n,) int64
        Index of every vertex in quarter turns; nonzero interior entries are singularities.  At a boundary vertex the
        sector holds 2 - index quads.
    periods : (loops,) int64
        Free integer that was chosen for every boundary loop (0 for the first).
    flux : (loops,) float64
        Closed integral of the normal derivative of the angle around every loop.
    residual : float
        Greatest misalignment on the boundary, radians.
    given : CrossField
        The field u that was aligned.
    phi, psi : (e,) float64
        The two parts of its rotation: ``field.theta = given.theta + phi + psi`` modulo pi/2.  psi vanishes on the boundary and
        has jumps of quarter turns, which carry indices to holes and vertices; phi has none (unless singularities were moved).
    added : tuple of int
        Singular vertices that the given field did not have, so that the indices fit.
    split : tuple of (int, int)
        Singular vertices whose index of 1/2 or more was shared, and where a quarter of it is now.
    moved : tuple of (int, int)
        Where singularities were before and are after the flux was made to vanish.
    """

    field: CrossField
    index: Int
    periods: Int
    flux: Float
    residual: float
    given: CrossField
    phi: Float
    psi: Float
    added: tuple[int, ...] = ()
    split: tuple[tuple[int, int], ...] = ()
    moved: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class FaceTMesh:
    """The T-mesh (motorcycle graph) of one face.

    Attributes
    ----------
    face : int
    position : (n, 2) or (n, 3) float64
        Local coordinates of the nodes.
    vertex : (n,) int64
        Background vertex of a node (singularities, corners, ports), -1 at T-junctions and ends of traces.
    index : (n,) int64
        Index of the node in quarter turns (0 where `vertex` is -1).
    half_edge : (n,) int64
        Row of `FaceMesh.boundary` on which a boundary node lies (the half-edge that starts there for a background
        vertex), -1 in the interior.
    half_edge_fraction : (n,) float64
        Place on that half-edge, in [0, 1).
    arcs : (a, 2) int64
        Start and end node; boundary arcs run with the face on the left.
    length : (a,) float64
    polyline : tuple of (k, 2) or (k, 3) float64
        Local coordinates from start to end.
    loop : (a,) int64
        Boundary loop of a boundary arc, -1 for a trace.
    patches : tuple of four sides, each a tuple of (arc, +1 or -1)
        Counter-clockwise around the patch; -1 runs an arc from end to start.
    """

    face: int
    position: Float
    vertex: Int
    index: Int
    half_edge: Int
    half_edge_fraction: Float
    arcs: Int
    length: Float
    polyline: tuple[Float, ...]
    loop: Int
    patches: tuple[tuple[tuple[tuple[int, int], ...], ...], ...]


@dataclass(frozen=True)
class TMesh:
    """The T-meshes of all faces, glued along the CAD curves.

    Attributes
    ----------
    position : (n, 3) float64, scaled
    cad_vertex : (n,) int64
        Row of `Model.vertices`, -1 elsewhere.  Node i is CAD vertex i for the first ``len(model.vertices)`` nodes.
    curve : (n,) int64; curve_arclength : (n,) float64
        CAD curve that a node is on (-1: none, or a CAD vertex) and where.
    critical : (n,) bool
        Nodes that must stay apart: CAD vertices, singularities, boundary nodes with an index, ports.
    quads_at : dict of (face row, node) -> int
        Number of quads that face has around a critical node (all its sectors together).
    arcs : (a, 2) int64; length : (a,) float64; polyline : tuple of (k, 3) float64
    arc_curve : (a,) int64; arc_start : (a,) float64
        CAD curve that an arc is a piece of, or -1, and the arc length where it starts; pieces run with the curve.
    pieces : tuple of tuple of int
        For every CAD curve its arcs in order.
    patches : tuple of four sides, each a tuple of (arc, +1 or -1)
    patch_face : (p,) int64
    loops : tuple of (face row, tuple of arcs)
        Every boundary loop of every face (after cutting along embedded curves).
    euler : (f,) int64
        Euler characteristic of every face, not cut.
    pinned : (n,) bool
        Nodes that keep their place because the user set it (CAD vertices do so anyway); none where it is left out.
    """

    position: Float
    cad_vertex: Int
    curve: Int
    curve_arclength: Float
    critical: Bool
    quads_at: dict[tuple[int, int], int]
    arcs: Int
    length: Float
    polyline: tuple[Float, ...]
    arc_curve: Int
    arc_start: Float
    pieces: tuple[tuple[int, ...], ...]
    patches: tuple[tuple[tuple[tuple[int, int], ...], ...], ...]
    patch_face: Int
    loops: tuple[tuple[int, tuple[int, ...]], ...]
    euler: Int
    pinned: Bool = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self) -> None:
        if not len(self.pinned):
            object.__setattr__(self, "pinned", np.zeros(len(self.position), bool))


@dataclass(frozen=True)
class Guide:
    """The guide grid: a coarse, smoothed quad mesh that carries the layout's geometry.

    Attributes
    ----------
    points : (n, 3) float64, scaled
    curve : (n,) int64
        CAD curve that the vertex slides on, -1 in the interior and at CAD vertices.
    arclength : (n,) float64
        Place on that curve.
    fixed : (n,) bool
        Vertices that must not move: CAD vertices, prescribed places (Transfinite), embedded points.
    cad_vertex : (n,) int64
        Row of `Model.vertices` or -1.
    quads : (q, 4) int64
        Counter-clockwise as seen from the side of their face's normal.
    quad_face : (q,) int64
    quad_block : (q,) int64
        Coarse block (unit cell of the conforming layout) that the quad belongs to.
    quad_size : (q, 2) float64
        Rest lengths along sides 0/2 and 1/3, from the T-mesh.
    chains : tuple of (k + 1,) int64
        For every CAD curve its vertices in order (closed: first repeated at the end).
    """

    points: Float
    curve: Int
    arclength: Float
    fixed: Bool
    cad_vertex: Int
    quads: Int
    quad_face: Int
    quad_block: Int
    quad_size: Float
    chains: tuple[Int, ...]


@dataclass(frozen=True)
class QuadMesh:
    """The final mesh, in the user's coordinates.

    Attributes
    ----------
    points : (n, 3) float64
        In the user's units.
    quads : (q, 4) int64
        Oriented as their CAD face.
    quad_face : (q,) int64
        Row of `Model.faces`.
    quad_block : (q,) int64
    vertex_node : (v,) int64
        Node of every CAD vertex.
    curve_nodes : tuple of (k + 1,) int64
        Nodes of every CAD curve in order.
    curve_parameters : tuple of (k + 1,) float64
        Their CAD parameters.
    face_nodes : tuple of (k,) int64
        Nodes inside every face (on no curve and no vertex).
    notes : tuple of str
        What the user should know (fall-backs that were taken).
    quad_tag : (q,) int64
        Gmsh tag of the CAD face of every quad, negative where that is oriented the other way; empty where all faces are single
        CAD faces.
    face_node_tag : tuple of (k,) int64
        Gmsh tag of the CAD face that each of `face_nodes` is on; as empty.
    """

    points: Float
    quads: Int
    quad_face: Int
    quad_block: Int
    vertex_node: Int
    curve_nodes: tuple[Int, ...]
    curve_parameters: tuple[Float, ...]
    face_nodes: tuple[Int, ...]
    notes: tuple[str, ...] = field(default=())
    quad_tag: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    face_node_tag: tuple[Int, ...] = ()
