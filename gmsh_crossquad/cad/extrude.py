"""Hexahedra from the quads of plane faces: the mesh swept along a vector, as a discrete model of its own.

Every entity of the mesh becomes three: itself, its copy at the end, and the one of the next dimension that it sweeps.  Points
sweep lines, curves side walls, faces volumes.  The entities at the start keep their tags; all others get the next free ones, but
that a volume has the tag of its face.  Boundaries and orientations are those of the CAD, so that the file is a model with
topology when Gmsh reads it again.

Physical groups go up with their entities, under the same name and number: surfaces to volumes, curves to surfaces, points to
curves.  The ends of a physical surface NAME are the physical surfaces NAME_bottom and NAME_top.

The elements of order p are taken as lattices of (p + 1)^d nodes, whose numbering Gmsh tells by the local coordinates of the nodes
(`getElementProperties`); so every order goes the same way, elements without inner nodes too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import gmsh
import numpy as np

from ..errors import GeometryError, InputError
from ..records import Bool, Float, Int, Model
from .session import gmsh_errors

__all__ = ["Extrusion", "extrude"]

PARALLEL = 1e-6  # sine of an angle

FAMILIES = ("Point", "Line", "Quadrangle", "Hexahedron")


@dataclass(frozen=True)
class Extrusion:
    """What `extrude` made.

    Attributes
    ----------
    model : str
        Name of the Gmsh model.
    nodes, hexahedra : int
    vector : (3,) float64
        From the start to the end.
    layers : int
    """

    model: str
    nodes: int
    hexahedra: int
    vector: Float
    layers: int


def extrude(
    model: Model, along: float | Sequence[float], layers: int, *, most: int | None = None, name: str | None = None
) -> Extrusion:
    """Sweep the mesh of the current Gmsh model, which stays as it is; the new model becomes the current one.

    Parameters
    ----------
    model : Model
        The current Gmsh model, with the mesh that `put_mesh` or `raise_order` has put on it.
    along : float or (3,) sequence of float
        Length along the normal of the first face (negative: against it), or the whole vector, in the user's units.
    layers : int
        Number of hexahedra along it, at least 1.
    most : int, optional
        Refuse to make more hexahedra.
    name : str, optional
        Name of the new model; default that of `model` with "extruded".

    Raises
    ------
    InputError
        Where the current model is another one; for a vector of no length or along the faces, and too few or too many layers.
    GeometryError
        For curved faces, faces that are not parallel, and a group that would have the name of an end.
    MeshError
        Gmsh refuses the mesh.
    """
    if gmsh.model.getCurrent() != model.name or not len(gmsh.model.mesh.getElementTypes(2)):
        raise InputError(f"the mesh of the model {model.name!r} is not there", remedy="make that model the current one, meshed")
    vector, upwards = _vector(model, along)
    if layers != int(layers) or layers < 1:
        raise InputError(f"the extrusion has {layers} layers", remedy="give a whole number, at least 1")
    with gmsh_errors("reading the mesh"):
        source = _Source.read(model)
    quads = sum(len(q) for q in source.faces)
    if most is not None and quads * layers > most:
        raise InputError(f"the extrusion would have {quads * layers} hexahedra", remedy="use fewer layers or raise --max-quads")
    groups = _groups(model)
    before = gmsh.model.getCurrent()
    taken = gmsh.model.list()
    wanted = name or f"{model.name} extruded"
    new = next(n for n in (wanted, *(f"{wanted} {k}" for k in range(2, len(taken) + 3))) if n not in taken)
    gmsh.model.add(new)
    try:
        with gmsh_errors("taking the extruded mesh"):
            tags = _entities(model, upwards)
            nodes = _mesh(source, tags, vector, int(layers), upwards)
            _put_groups(groups, tags)
    except BaseException:
        gmsh.model.remove()
        gmsh.model.setCurrent(before)
        raise
    return Extrusion(new, nodes, quads * int(layers), vector, int(layers))


def _vector(model: Model, along: float | Sequence[float]) -> tuple[Float, Bool]:
    """The vector, and for every face whether its normal is on the side of it."""
    for face in model.faces:
        if face.curved:
            raise GeometryError("a curved face cannot be extruded", entity=(2, face.tag), remedy="extrude plane models only")
    normals = np.array([face.normal for face in model.faces])
    turned = np.flatnonzero(np.linalg.norm(np.cross(normals, normals[0]), axis=1) > PARALLEL)
    if len(turned):
        tag = model.faces[turned[0]].tag
        raise GeometryError("the faces to extrude are not parallel", entity=(2, tag), remedy="extrude models in one plane only")
    vector = np.asarray(along, float)
    if vector.ndim == 0:
        vector = vector * normals[0]
    length = float(np.linalg.norm(vector)) if vector.shape == (3,) else 0.0
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"the extrusion has the vector {along!r}", remedy="give a length, or three components DX,DY,DZ")
    height = normals @ vector
    if abs(height[0]) <= PARALLEL * length:
        raise InputError("the extrusion runs along the faces", remedy=f"the normal is {normals[0].round(6).tolist()}")
    return vector, height > 0


@dataclass(frozen=True)
class _Source:
    """The mesh of the plane model; nodes are rows of `points`.

    Attributes
    ----------
    order : int
    incomplete : bool
    points : (n, 3) float64
    own : list of list of (k,) int64
        Nodes of every vertex, curve and face alone.
    lines, faces : list of (k, ...) int64
        Lattices (k, p + 1) of the lines of every curve and (k, p + 1, p + 1) of the quads of every face, -1 where there is no
        node.
    """

    order: int
    incomplete: bool
    points: Float
    own: list[list[Int]]
    lines: list[Int]
    faces: list[Int]

    @classmethod
    def read(cls, model: Model) -> _Source:
        numbers, x, _ = gmsh.model.mesh.getNodes()
        row = np.full(int(numbers.max()) + 1, -1, np.int64)
        row[numbers.astype(np.int64)] = np.arange(len(numbers))
        kind = int(gmsh.model.mesh.getElementTypes(2, model.faces[0].tag)[0])
        _, _, order, n, _, _ = gmsh.model.mesh.getElementProperties(kind)
        entities = (
            [int(t) for t in model.vertex_tags],
            [curve.tag for curve in model.curves],
            [face.tag for face in model.faces],
        )
        none = np.zeros(0, np.int64)
        own = [
            [row[gmsh.model.mesh.getNodes(dim, t)[0].astype(np.int64)] if t >= 0 else none for t in tags]
            for dim, tags in enumerate(entities)
        ]
        lattices = []
        for dim in (1, 2):
            found = []
            for tag in entities[dim]:
                kinds, _, nodes = gmsh.model.mesh.getElements(dim, tag)
                place = _lattice(int(kinds[0]))
                lattice = np.full((len(nodes[0]) // len(place), *[order + 1] * dim), -1, np.int64)
                lattice[(slice(None), *place.T)] = row[nodes[0].astype(np.int64)].reshape(-1, len(place))
                found.append(lattice)
            lattices.append(found)
        return cls(int(order), n < (order + 1) ** 2, x.reshape(-1, 3), own, *lattices)


def _lattice(kind: int) -> Int:
    """Places (n, dim) of the nodes of an element in its lattice."""
    _, dim, order, n, local, _ = gmsh.model.mesh.getElementProperties(kind)
    places = (np.reshape(local, (n, dim)) + 1) * (0.5 * order)
    out: Int = np.rint(places).astype(np.int64)
    return out


@dataclass
class _Tags:
    """Tags in the new model by dimension of the source (0 to 2) and row there; -1 where there is none."""

    bottom: list[list[int]] = field(default_factory=list)
    top: list[list[int]] = field(default_factory=list)
    swept: list[list[int]] = field(default_factory=list)
    row: list[dict[int, int]] = field(default_factory=list)  # of a source tag


def _entities(model: Model, upwards: Bool) -> _Tags:
    """The entities of the new model."""
    out = _Tags()
    sources = [[int(t) for t in model.vertex_tags], [c.tag for c in model.curves], [f.tag for f in model.faces]]
    next_tag = [max([0, *s]) + 1 for s in sources]
    for dim, tags in enumerate(sources):
        out.bottom.append(tags)
        out.row.append({t: i for i, t in enumerate(tags) if t >= 0})
        for which, d in ((out.top, dim), (out.swept, dim + 1)):
            if d == 3:
                which.append(list(tags))
                continue
            which.append([next_tag[d] + k if t >= 0 else -1 for k, t in enumerate(tags)])
            next_tag[d] += len(tags)
    add = gmsh.model.addDiscreteEntity
    for level in (out.bottom, out.top):
        for tag in level[0]:
            if tag >= 0:
                add(0, tag)
        for curve, tag in zip(model.curves, level[1]):
            add(1, tag, [level[0][v] for v in (curve.start, curve.end) if level[0][v] >= 0])
    for low, high, tag in zip(out.bottom[0], out.top[0], out.swept[0]):
        if tag >= 0:
            add(1, tag, [low, high])
    for level in (out.bottom, out.top):
        for face, tag in zip(model.faces, level[2]):
            add(2, tag, [sign * level[1][c] for loop in face.loops for c, sign in loop])
    for c, (curve, tag) in enumerate(zip(model.curves, out.swept[1])):
        start, end = out.swept[0][curve.start], out.swept[0][curve.end]
        ends = [end, -out.top[1][c], -start] if start >= 0 else [-out.top[1][c]]
        add(2, tag, [out.bottom[1][c], *ends])
    for f, (face, tag) in enumerate(zip(model.faces, out.swept[2])):
        side = 1 if upwards[f] else -1
        walls = [side * sign * out.swept[1][c] for loop in face.loops for c, sign in loop]
        add(3, tag, [-side * out.bottom[2][f], side * out.top[2][f], *walls])
    return out


def _mesh(source: _Source, tags: _Tags, vector: Float, layers: int, upwards: Bool) -> int:
    """Nodes and elements of the new model; the number of nodes."""
    p, n, levels = source.order, len(source.points), layers * source.order
    kinds = [gmsh.model.mesh.getElementType(FAMILIES[d], p, source.incomplete) if d else 15 for d in range(4)]
    places = [np.zeros((1, 0), np.int64), *(_lattice(k) for k in kinds[1:])]
    vertices = [own[:1] for own in source.own[0]]
    elements: list[tuple[int, int, Int]] = []  # dimension, tag, nodes with their level: level * n + row
    for dim, lattices in enumerate((vertices, source.lines, source.faces)):
        for row, lattice in enumerate(lattices):
            if not len(lattice):
                continue
            flat = lattice[(slice(None), *places[dim].T)].reshape(len(lattice), -1)
            elements += [(dim, tags.bottom[dim][row], flat), (dim, tags.top[dim][row], flat + levels * n)]
            place = places[dim + 1]
            up = lattice.swapaxes(1, 2) if dim == 2 and not upwards[row] else lattice
            cell = up[(slice(None), *place[:, :dim].T)].reshape(len(lattice), -1) + n * place[:, dim]
            swept = cell + (p * n * np.arange(layers))[:, None, None]
            elements.append((dim + 1, tags.swept[dim][row], swept.reshape(-1, len(place))))
    used = np.zeros((levels + 1) * n, bool)
    for _, _, nodes in elements:
        used[nodes.ravel()] = True
    number = np.cumsum(used)
    share = np.arange(levels + 1) / levels
    for dim, rows in enumerate(source.own):
        for row, own in enumerate(rows):
            if not len(own):
                continue
            inside = np.arange(1, levels)
            swept_tag = tags.swept[dim][row]
            for d, tag, level in (
                (dim, tags.bottom[dim][row], np.array([0])),
                (dim, tags.top[dim][row], np.array([levels])),
                (dim + 1, swept_tag, inside),
            ):
                key = (level[:, None] * n + own).ravel()
                key = key[used[key]]
                if len(key):
                    x = source.points[key % n] + share[key // n, None] * vector
                    if d == 0:
                        gmsh.model.setCoordinates(tag, *x[0])
                    gmsh.model.mesh.addNodes(d, tag, number[key], x.ravel())
    first = 1
    for dim, tag, nodes in sorted(elements, key=lambda e: e[0]):
        gmsh.model.mesh.addElementsByType(tag, kinds[dim], np.arange(first, first + len(nodes)), number[nodes].ravel())
        first += len(nodes)
    return int(number[-1])


def _groups(model: Model) -> list[tuple[int, int, str, list[int]]]:
    """Physical groups of the source: dimension, tag, name and those of their entities that are in the mesh."""
    known = [set(model.vertex_tags.tolist()), {c.tag for c in model.curves}, {f.tag for f in model.faces}]
    out = []
    for dim, tag in gmsh.model.getPhysicalGroups():
        if dim < 3:
            entities = [int(t) for t in gmsh.model.getEntitiesForPhysicalGroup(dim, tag) if int(t) in known[dim]]
            out.append((dim, int(tag), gmsh.model.getPhysicalName(dim, tag), entities))
    walls = {name for dim, _, name, entities in out if dim == 1 and entities and name}
    for dim, tag, name, entities in out:
        for end in ("bottom", "top"):
            if dim == 2 and entities and f"{name or tag}_{end}" in walls:
                what = f"the physical curve {f'{name or tag}_{end}'!r} would have the name of an end of the extrusion"
                raise GeometryError(what, remedy="give it another name")
    return out


def _put_groups(groups: list[tuple[int, int, str, list[int]]], tags: _Tags) -> None:
    """Groups of the new model."""
    free = max((tag for dim, tag, _, _ in groups if dim == 1), default=0) + 1
    for dim, tag, name, entities in groups:
        if not entities:
            continue
        rows = [tags.row[dim][e] for e in entities]
        gmsh.model.addPhysicalGroup(dim + 1, [tags.swept[dim][r] for r in rows], tag, name)
        if dim == 2:
            for end, level in (("bottom", tags.bottom), ("top", tags.top)):
                gmsh.model.addPhysicalGroup(2, [level[2][r] for r in rows], free, f"{name or tag}_{end}")
                free += 1
