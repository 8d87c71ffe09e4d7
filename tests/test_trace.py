import numpy as np
import pytest
from models import annulus, background, square
from tracing import field_of, midpoints, polygon_mesh

from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.layout.crossing import AROUND, ONE, Chord, beside, meet, on_left
from gmsh_crossquad.layout.face_tmesh import trace_face
from gmsh_crossquad.layout.ports import fan
from gmsh_crossquad.layout.step import CLEAR, ideal_exit
from gmsh_crossquad.layout.trace import grow
from gmsh_crossquad.layout.trace_mesh import trace_mesh
from gmsh_crossquad.records import FaceMesh


def uniform(n: int = 5, turn: float = 0.0):
    """A turned square with a constant field, laid out."""
    mesh = polygon_mesh(4, n, np.pi / 4 + turn)
    field = field_of(mesh, np.full(len(midpoints(mesh)), turn))
    aligned = aligned_field(mesh, field)
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    return mesh, trace_mesh(mesh, surface, aligned, np.zeros(len(mesh.points), bool))


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_constant_field_is_followed_straight(turn: float) -> None:
    _, tracing = uniform(5, turn)
    checked = 0
    for h in range(len(tracing.start)):
        for branch in range(4):
            angle = tracing.value[h] + branch * np.pi / 2
            d = np.array([np.cos(angle), np.sin(angle)])
            out, s = ideal_exit(tracing, h, 0.37, branch)
            assert out // 3 == h // 3 and out != h
            if tracing.ux[h] * d[1] - tracing.uy[h] * d[0] < 0.02 or not CLEAR < s < 1 - CLEAR:
                continue
            x = tracing.x[out] + s * tracing.ex[out] - tracing.x[h] - 0.37 * tracing.ex[h]
            y = tracing.y[out] + s * tracing.ey[out] - tracing.y[h] - 0.37 * tracing.ey[h]
            assert abs(d[0] * y - d[1] * x) < 1e-12 and d[0] * x + d[1] * y > 0
            checked += 1
    assert checked > len(tracing.start)


def test_left_of_a_chord() -> None:
    chord = Chord(ONE // 2, ONE + ONE // 2, 0, 0, 0, None)  # from side 0 to side 1: corner 1 is cut off, on the right
    assert not on_left(chord, ONE)
    assert on_left(chord, 0) and on_left(chord, 2 * ONE + 5)
    assert AROUND == 3 * ONE


SOUTH, EAST, WEST = ONE // 2, ONE + ONE // 2, 2 * ONE + ONE // 2  # middles of the sides of a triangle


@pytest.mark.parametrize("branch", range(4))
def test_chords_cross_in_one_way_only(branch: int) -> None:
    old = Chord(SOUTH, WEST, branch, 0, 0, None)  # cuts corner 0 off, on its left
    assert meet([old], EAST, ONE // 4, (branch + 1) % 4) == (old, False)  # from right to left
    assert meet([old], EAST, ONE // 4, (branch + 3) % 4) == (None, True)
    assert meet([old], ONE // 4, EAST, (branch + 3) % 4) == (old, False)
    assert meet([old], ONE // 4, EAST, (branch + 1) % 4) == (None, True)
    for same in (branch, (branch + 2) % 4):
        assert meet([old], EAST, ONE // 4, same) == (None, True)
        exit_ = beside([old], EAST, ONE // 4, same, [])
        assert SOUTH < exit_ < ONE and meet([old], EAST, exit_, same) == (None, False)
        exit_ = beside([old], EAST, ONE // 4, same, [0])
        assert 2 * ONE < exit_ < WEST
        assert beside([old], EAST, ONE // 4, same, [0, 2]) == -1


def test_the_nearest_chord_is_met_first() -> None:
    near, far = Chord(SOUTH + 9, WEST - 9, 0, 0, 0, None), Chord(SOUTH, WEST, 0, 1, 0, None)
    assert meet([far, near], EAST, ONE // 4, 1) == (near, False)
    assert meet([far, near], ONE // 4, EAST, 3) == (far, False)


def test_a_stopped_chord_is_not_behind_its_host() -> None:
    host = Chord(SOUTH, WEST, 0, 0, 0, None)
    stopped = Chord(EAST, ONE // 4, 1, 1, 0, host)  # ends on the right of the host; only on paper it goes on
    assert meet([stopped], ONE // 8, 3 * ONE - 9, 1) == (None, False)
    assert meet([stopped], ONE - 9, 2 * ONE + 9, 0) == (stopped, False)


@pytest.mark.parametrize("h", [0.2, 0.1])
def test_port_on_a_side_goes_straight_across(h: float) -> None:
    (mesh,) = background(square(), h)
    aligned = aligned_field(mesh)
    row = int(np.flatnonzero(mesh.boundary_curve == 0)[1])
    start = int(mesh.boundary[row, 0])
    tmesh = trace_face(mesh, aligned, [start])
    (trace,) = [p for p, loop in zip(tmesh.polyline, tmesh.loop) if loop < 0]
    side = np.ptp(mesh.points, axis=0).max()
    assert np.ptp(trace[:, 0]) < 2 * CLEAR * h and np.isclose(np.ptp(trace[:, 1]), side)
    assert len(tmesh.patches) == 2


def bipolar_end(centre: float, inner: float, start: float) -> np.ndarray:
    """Where the circle through the unit circle at angle `start`, orthogonal to it and to the inner circle, meets the latter."""
    # limit points (p, 0), (1/p, 0) of the pencil: both circles are Apollonian circles of them
    b = (1 + centre**2 - inner**2) / centre
    p = (b - np.sqrt(b * b - 4)) / 2
    z = np.exp(1j * start)
    # w = (z - p)/(z - 1/p) maps the pencil to concentric circles; orthogonal circles become rays
    w = (z - p) / (z - 1 / p)
    edge = centre - inner
    radius = abs((edge - p) / (edge - 1 / p))
    w *= radius / abs(w)
    end = (p - w / p) / (1 - w)
    return np.array([end.real, end.imag])


def test_eccentric_annulus_converges_to_bipolar_coordinates() -> None:
    centre, inner = 0.3, 0.4
    model = annulus(inner, 1.0, (centre, 0.0))
    errors = []
    for h in (0.06, 0.03):
        (mesh,) = background(model, h)
        aligned = aligned_field(mesh)
        outer = mesh.boundary[mesh.boundary_curve == 0, 0]
        angle = np.arctan2(*(mesh.points[outer] * model.scale + model.origin[:2])[:, ::-1].T)
        start = int(outer[np.abs(angle - 1.5).argmin()])
        tmesh = trace_face(mesh, aligned, [start])
        (node,) = np.flatnonzero(tmesh.vertex < 0)
        found = tmesh.position[node] * model.scale + model.origin[:2]
        true = bipolar_end(centre, inner, float(angle[np.flatnonzero(outer == start)[0]]))
        errors.append(np.linalg.norm(found - true))
    assert errors[0] < 0.02 and errors[1] < 0.5 * errors[0]


def emitted(mesh: FaceMesh, seeds: list[int]):
    aligned = aligned_field(mesh)
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    seed = np.zeros(len(mesh.points), bool)
    seed[seeds] = True
    tracing = trace_mesh(mesh, surface, aligned, seed)
    at = {v: h for h, v in enumerate(tracing.start)}
    at |= {v: h for h, v in enumerate(tracing.start) if tracing.wall[h] >= 0}
    return tracing, [(v, fan(tracing, at[v], int(aligned.index[v]))) for v in seeds]


def test_the_younger_trace_stops() -> None:
    (mesh,) = background(square(), 0.1)
    first = int(mesh.boundary[np.flatnonzero(mesh.boundary_curve == 0)[1], 0])
    second = int(mesh.boundary[np.flatnonzero(mesh.boundary_curve == 3)[1], 0])
    a, b = mesh.points[first], mesh.points[second]
    meeting = np.array([a[0], b[1]])
    tracing, seeds = emitted(mesh, [first, second])
    traces = grow(tracing, seeds, 1000)
    late = int(np.linalg.norm(meeting - b) > np.linalg.norm(meeting - a))
    assert traces[late].host is not None and traces[late].host.trace == 1 - late
    assert traces[1 - late].host is None


def test_too_many_steps_are_an_error() -> None:
    (mesh,) = background(square(), 0.1)
    tracing, seeds = emitted(mesh, [int(mesh.boundary[np.flatnonzero(mesh.boundary_curve == 0)[1], 0])])
    with pytest.raises(LayoutError, match="does not end"):
        grow(tracing, seeds, 2)


def test_same_family_never_crosses_where_the_field_is_useless() -> None:
    """Nearly tangential, random chords of one family: the order along edges decides, never an angle."""
    rng = np.random.default_rng(3)
    mesh = polygon_mesh(4, 6, np.pi / 4)
    mid = midpoints(mesh)
    aligned = aligned_field(mesh, field_of(mesh, 0.3 * rng.standard_normal(len(mid)) * (np.abs(mid).max(axis=1) < 0.6)))
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    tracing = trace_mesh(mesh, surface, aligned, np.zeros(len(mesh.points), bool))
    noise = rng.uniform(-0.7, 0.7, len(tracing.constant))
    tracing.constant = [c + d for c, d in zip(tracing.constant, noise)]
    rows = [h for h, w in enumerate(tracing.wall) if w >= 0]
    seeds = [(tracing.start[h], fan(tracing, h, 0)) for h in rows if np.abs(tracing.points[tracing.start[h]]).min() < 0.5]
    traces = grow(tracing, seeds, 1000)
    chords: dict[int, list[tuple[int, int, int]]] = {}
    for trace in traces:
        for i, (h, place) in enumerate(trace.crossings[:-1]):
            out, end = trace.crossings[i + 1]
            g = tracing.twin[h]
            chords.setdefault(out // 3, []).append(
                (g % 3 * ONE + ONE - place, out % 3 * ONE + end, i + 2 == len(trace.crossings))
            )
    whole = {t: [c[:2] for c in group if not c[2]] for t, group in chords.items()}
    pairs = [(p, q) for group in whole.values() for i, p in enumerate(group) for q in group[:i]]
    assert len(pairs) > 20
    for (a, b), (c, d) in pairs:  # two chords that both go on can only be of one family, or they would have stopped
        x, y, z = ((u - a) % AROUND for u in (b, c, d))
        assert (y < x) == (z < x)
