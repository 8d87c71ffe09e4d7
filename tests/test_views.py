"""Gmsh views in and out."""

import gmsh
import models
import numpy as np
import pytest

from gmsh_crossquad.cad.views import add_field_views, read_view_file, view_samples, write_field_views
from gmsh_crossquad.errors import FieldError, GeometryError, InputError
from gmsh_crossquad.face_field import face_field, singularities_of
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field_stage import edge_frames
from gmsh_crossquad.source.known import Known

ANGLE = 0.3
ARM = np.array([np.cos(ANGLE), np.sin(ANGLE), 0.0])
TENSOR = (5 * np.outer(ARM, ARM) + 2 * np.diag([1.0, 1.0, 0.0])).ravel()
VALUES = {"vector": ARM, "tensor": TENSOR, "angle": np.array([ANGLE])}


pytestmark = pytest.mark.usefixtures("gmsh_session")


@pytest.fixture(autouse=True)
def fresh():
    gmsh.clear()
    gmsh.onelab.clear()


@pytest.fixture(scope="module")
def fields():
    """Model, meshes and fields of a square with a disc in it."""
    model = models.two_materials()
    meshes = models.background(model, 0.06)
    return model, meshes, tuple(face_field(model, m, aligned_field(m)) for m in meshes)


@pytest.fixture(scope="module")
def square_frames():
    model = models.square()
    (mesh,) = models.background(model, 0.1)
    return edge_frames(model, mesh)


def off(theta, other):
    """Difference of cross angles."""
    d = np.abs(np.asarray(theta) - other) % (np.pi / 2)
    return np.minimum(d, np.pi / 2 - d).max()


def assert_constant(samples, frames):
    expected = frames.angles(np.broadcast_to(ARM, frames.places.shape))
    assert off(samples.on(frames).theta, expected) < 1e-10


def square_mesh(name="square", recombined=False, order=1):
    """The unit square of the built-in kernel, meshed."""
    gmsh.model.add(name)
    for p in ((0, 0), (1, 0), (1, 1), (0, 1)):
        gmsh.model.geo.addPoint(*p, 0, 0.15)
    for i in range(4):
        gmsh.model.geo.addLine(i + 1, (i + 1) % 4 + 1)
    gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop([1, 2, 3, 4])])
    gmsh.model.geo.synchronize()
    if recombined:
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.RecombineAll", 0)
    gmsh.model.mesh.setOrder(order)


def view_on_mesh(kind, value, title="a", step=0, view=None):
    """A view of the current model with the same value everywhere."""
    view = gmsh.view.add(title) if view is None else view
    if kind == "NodeData":
        tags = gmsh.model.mesh.getNodes()[0]
        data = [value] * len(tags)
    else:
        tags, data = [], []
        for element_type in gmsh.model.mesh.getElementTypes(2):
            elements, _ = gmsh.model.mesh.getElementsByType(element_type)
            corners = gmsh.model.mesh.getElementProperties(element_type)[3] if kind == "ElementNodeData" else 1
            tags.extend(elements)
            data.extend([np.tile(value, corners)] * len(elements))
    gmsh.view.addModelData(view, step, gmsh.model.getCurrent(), kind, tags, data, float(step), len(value))
    return view


# ---- views of the session


@pytest.mark.parametrize("value", VALUES)
@pytest.mark.parametrize("kind", ["NodeData", "ElementData", "ElementNodeData"])
def test_views_on_a_mesh(kind, value, square_frames):
    square_mesh()
    assert_constant(view_samples(view_on_mesh(kind, VALUES[value])), square_frames)


@pytest.mark.parametrize("kind", ["NodeData", "ElementData", "ElementNodeData"])
@pytest.mark.parametrize(("recombined", "order"), [(True, 1), (False, 2), (True, 2), (False, 3)])
def test_kinds_of_elements(kind, recombined, order, square_frames):
    square_mesh(recombined=recombined, order=order)
    assert_constant(view_samples(view_on_mesh(kind, ARM)), square_frames)


def test_values_on_part_of_the_mesh():
    """Elements without values do not count; the others are those with x < 1/2."""
    square_mesh()
    elements, nodes = gmsh.model.mesh.getElementsByType(2)
    x = np.array([gmsh.model.mesh.getNode(n)[0][0] for n in nodes]).reshape(-1, 3)
    left = elements[(x < 0.5).all(axis=1)]
    view = gmsh.view.add("left")
    gmsh.view.addHomogeneousModelData(view, 0, "square", "ElementData", left, np.tile(ARM, len(left)), 0.0, 3)
    samples = view_samples(view)
    assert len(samples.triangles) == len(left)
    assert samples.positions[:, 0].max() < 0.5


def test_linear_vectors_on_nodes_sit_at_their_nodes(square_frames):
    """The direction (1, x + y) changes from node to node: a mixed-up order would show."""
    square_mesh()
    tags, points, _ = gmsh.model.mesh.getNodes()
    points = points.reshape(-1, 3)
    view = gmsh.view.add("linear")
    values = np.stack([np.ones(len(points)), points[:, 0] + points[:, 1], np.zeros(len(points))], axis=1)
    turn = np.random.default_rng(0).permutation(len(tags))
    gmsh.view.addHomogeneousModelData(view, 0, "square", "NodeData", tags[turn], values[turn].ravel(), 0.0, 3)
    places = square_frames.places
    exact = np.stack([np.ones(len(places)), places[:, 0] + places[:, 1], np.zeros(len(places))], axis=1)
    assert off(view_samples(view).on(square_frames).theta, square_frames.angles(exact)) < 0.01


@pytest.mark.parametrize("value", VALUES)
@pytest.mark.parametrize("shape", ["T", "Q"])
def test_lists(value, shape, square_frames):
    """The square as two triangles or one quadrangle; two time steps, of which the second is shown."""
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
    cells = [[0, 1, 2], [0, 2, 3]] if shape == "T" else [[0, 1, 2, 3]]
    letter = {"vector": "V", "tensor": "T", "angle": "S"}[value]
    wrong = np.zeros_like(VALUES[value])
    data = [x for c in cells for x in (*corners[c].T.ravel(), *np.tile(wrong, len(c)), *np.tile(VALUES[value], len(c)))]
    view = gmsh.view.add("list")
    gmsh.view.addListData(view, letter + shape, len(cells), data)
    gmsh.view.addListData(view, "SP", 1, [0, 0, 0, 1, 1])  # not on a surface: left out
    gmsh.view.option.setNumber(view, "TimeStep", 1)
    assert_constant(view_samples(view), square_frames)


def test_the_time_step_that_is_shown(square_frames):
    square_mesh()
    view = view_on_mesh("NodeData", np.array([1.0, 0, 0]))
    view_on_mesh("NodeData", ARM, step=1, view=view)
    gmsh.view.option.setNumber(view, "TimeStep", 1)
    assert_constant(view_samples(view), square_frames)


def test_a_time_step_without_values():
    square_mesh()
    view = view_on_mesh("NodeData", ARM, step=2)
    with pytest.raises(FieldError, match="no values at its time step 0"):
        view_samples(view)


def test_view_on_the_mesh_of_another_model(square_frames):
    square_mesh("with the view")
    view = view_on_mesh("NodeData", ARM)
    gmsh.model.add("larger")  # has all tags of the other
    gmsh.model.occ.addRectangle(0, 0, 0, 50, 50)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 2)
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1e22)
    assert_constant(view_samples(view), square_frames)
    assert gmsh.model.getCurrent() == "larger"
    gmsh.model.setCurrent("with the view")
    gmsh.model.remove()
    gmsh.model.setCurrent("larger")
    gmsh.model.mesh.clear()
    with pytest.raises(FieldError, match="in no model"):
        view_samples(view)


@pytest.mark.parametrize(
    ("kind", "data", "message"),
    [
        ("SP", [0, 0, 0, 1], "no triangles"),
        ("ST", [0, 1, 0, 0, 0, 1, 0, 0, 0, np.nan, 0, 0], "finite"),
        ("VT", [0, 1, 0, 0, 0, 1, 0, 0, 0] + [0.0] * 9, "zero everywhere"),
        ("VL", [0, 1, 0, 0, 0, 0] + [1.0] * 6, "no triangles"),
    ],
)
def test_lists_that_are_no_field(kind, data, message):
    view = gmsh.view.add("bad")
    gmsh.view.addListData(view, kind, 1, data)
    with pytest.raises(FieldError, match=message):
        view_samples(view)


def test_other_views_that_are_no_field():
    with pytest.raises(InputError, match="no view 99: the views are: none"):
        view_samples(99)
    view = gmsh.view.add("empty")
    with pytest.raises(FieldError, match="no triangles"):
        view_samples(view)
    gmsh.view.addListData(view, "ST", 1, [0, 1, 0, 0, 0, 1, 0, 0, 0] + [1.0] * 3)
    gmsh.view.addListData(view, "VT", 1, [0, 1, 0, 0, 0, 1, 0, 0, 0] + [1.0] * 9)
    with pytest.raises(FieldError, match="several kinds"):
        view_samples(view)
    square_mesh()
    lines, _ = gmsh.model.mesh.getElementsByType(1)
    view = gmsh.view.add("on curves")
    gmsh.view.addHomogeneousModelData(view, 0, "square", "ElementData", lines, np.tile(ARM, len(lines)), 0.0, 3)
    with pytest.raises(FieldError, match="no values on triangles"):
        view_samples(view)


# ---- files


def test_field_out_and_in_again_bit_for_bit(fields, tmp_path):
    _, _, faces = fields
    write_field_views(faces, tmp_path / "field.msh")
    found = read_view_file(tmp_path / "field.msh")
    assert isinstance(found, Known)
    assert [f.face for f in found.faces] == [1, 2]
    for f, g in zip(faces, found.faces, strict=True):
        for name in ("points", "triangles", "edges", "directions", "given", "normal", "phi", "psi", "rotation", "index", "seeds"):
            np.testing.assert_array_equal(getattr(f, name), getattr(g, name), err_msg=name)
        assert off(f.theta, g.theta) < 1e-14


@pytest.mark.parametrize("name", ["v", "v across"])
def test_one_view_of_a_field_file_has_the_crosses_at_the_edges(fields, tmp_path, name):
    model, meshes, faces = fields
    write_field_views(faces, tmp_path / "field.msh")
    samples = read_view_file(tmp_path / "field.msh", name)
    for mesh, f in zip(meshes, faces, strict=True):
        assert off(samples.on(edge_frames(model, mesh)).theta, f.theta) < 1e-9


def test_views_in_the_session_have_the_crosses_at_the_edges(fields):
    model, meshes, faces = fields
    views = add_field_views(faces)
    assert sorted(gmsh.view.getTags()) == sorted(views.values())
    for name in ("v", "v across"):
        samples = view_samples(views[name])
        for mesh, f in zip(meshes, faces, strict=True):
            assert off(samples.on(edge_frames(model, mesh)).theta, f.theta) < 1e-9
    _, _, (points,) = gmsh.view.getListData(views["singularities"])
    expected = [(*s.point, s.index) for f in faces for s in singularities_of(f)]
    np.testing.assert_allclose(np.reshape(points, (-1, 4)), expected)
    assert expected


def test_singularities_in_a_file(fields, tmp_path):
    _, _, faces = fields
    write_field_views(faces, tmp_path / "field.msh")
    gmsh.open(str(tmp_path / "field.msh"))
    (view,) = [t for t in gmsh.view.getTags() if gmsh.view.option.getString(t, "Name") == "singularities"]
    kind, tags, values, _, _ = gmsh.view.getHomogeneousModelData(view, 0)
    assert kind == "ElementData"
    nodes = [gmsh.model.mesh.getElement(t)[1][0] for t in tags]
    found = sorted((*gmsh.model.mesh.getNode(n)[0].round(9), v) for n, v in zip(nodes, values, strict=True))
    expected = sorted((*s.point.round(9), s.index) for f in faces for s in singularities_of(f))
    np.testing.assert_allclose(found, expected)


def write_view_file(path, titles, value=ARM):
    """A .msh file with some views of the same values."""
    square_mesh("to be written")
    gmsh.write(str(path))
    for title in titles:
        view = view_on_mesh("NodeData", value, title)
        gmsh.view.write(view, str(path), append=True)
        gmsh.view.remove(view)
    gmsh.model.remove()


def state():
    names = gmsh.onelab.getNames()
    return (
        gmsh.model.getCurrent(),
        gmsh.model.list(),
        gmsh.view.getTags().tolist(),
        [(n, list(gmsh.onelab.getNumber(n)), gmsh.onelab.getString(n)) for n in names],
        [gmsh.option.getNumber(f"General.{o}") for o in ("MinX", "MaxY", "BoundingBoxSize", "Terminal", "AbortOnError")],
        [gmsh.option.getNumber(f"Mesh.{o}") for o in ("Binary", "SaveAll", "MshFileVersion")],
    )


def test_file_with_one_view(tmp_path, square_frames):
    write_view_file(tmp_path / "one.msh", ["stress"], TENSOR)
    for name in (None, "stress"):
        assert_constant(read_view_file(tmp_path / "one.msh", name), square_frames)
    with pytest.raises(InputError, match=r"no view 'strain': its views are: 'stress'"):
        read_view_file(tmp_path / "one.msh", "strain")


def test_file_with_several_views(tmp_path, square_frames):
    write_view_file(tmp_path / "two.msh", ["a", "b"])
    assert_constant(read_view_file(tmp_path / "two.msh", "b"), square_frames)
    with pytest.raises(FieldError, match=r"has 2 views: choose one of its views: 'a', 'b'"):
        read_view_file(tmp_path / "two.msh")
    write_view_file(tmp_path / "none.msh", [])
    with pytest.raises(FieldError, match="has 0 views"):
        read_view_file(tmp_path / "none.msh")


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        (b"hello", FieldError, "no Gmsh mesh file"),
        (b"SystemCall 'touch ran';", FieldError, "no Gmsh mesh file"),
        (b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 2", FieldError, "cannot read"),
        (b"", GeometryError, "empty"),
        (None, InputError, "no such file"),
    ],
)
def test_bad_files_change_nothing(tmp_path, content, error, message):
    path = tmp_path / "bad.msh"
    if content is not None:
        path.write_bytes(content)
    gmsh.model.add("mine")
    gmsh.model.occ.addBox(0, 0, 0, 1, 2, 3)
    gmsh.model.occ.synchronize()
    before = state()
    with pytest.raises(error, match=message) as caught:
        read_view_file(path)
    assert "\n" not in str(caught.value)
    assert state() == before


def test_writing_and_reading_leave_the_session_alone(fields, tmp_path):
    gmsh.open(str(write_geo(tmp_path)))
    own = gmsh.view.add("mine")
    before = state()
    write_field_views(fields[2], tmp_path / "field.msh")
    assert state() == before
    read_view_file(tmp_path / "field.msh")
    assert state() == before
    assert gmsh.view.getTags().tolist() == [own]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["field.msh", "mine.geo"]


def write_geo(folder):
    (folder / "mine.geo").write_text(
        'SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 1, 2, 3};\na = DefineNumber[1, Name "A/a"];\n'
    )
    return folder / "mine.geo"


def test_no_folder(fields, tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        write_field_views(fields[2], tmp_path / "missing" / "field.msh")
