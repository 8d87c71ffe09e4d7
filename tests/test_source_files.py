import numpy as np
import pytest

from gmsh_crossquad.errors import FieldError, InputError
from gmsh_crossquad.field.smooth import edge_angle, wrap
from gmsh_crossquad.source.files import read_field

from .field_meshes import grid, middles
from .source_frames import frames_of, random_square

meshio = pytest.importorskip("meshio")

MESH = grid(6, 6)
N = len(MESH.points)
ANGLE = 0.1 + 0.05 * MESH.points[:, 0]
D = np.stack([np.cos(ANGLE), np.sin(ANGLE), 0 * ANGLE], axis=1)
E = np.stack([-np.sin(ANGLE), np.cos(ANGLE), 0 * ANGLE], axis=1)
T = D[:, :, None] * D[:, None, :] - 3 * E[:, :, None] * E[:, None, :]
VOIGT = np.stack([T[:, 0, 0], T[:, 1, 1], T[:, 2, 2], T[:, 0, 1], T[:, 1, 2], T[:, 0, 2]], axis=1)
PLANE = VOIGT[:, [0, 1, 3]]
PRESSURE = 1 + MESH.points[:, 1]


def written(path, point_data=None, cell_data=None, cells=None, points=None):
    p = np.column_stack([MESH.points, np.zeros(N)]) if points is None else points
    cells = [("line", np.array([[0, 1]])), ("triangle", MESH.triangles)] if cells is None else cells
    cell_data = {k: [np.zeros((1, *v.shape[1:])), v] for k, v in (cell_data or {}).items()}
    meshio.Mesh(p, cells, point_data=point_data, cell_data=cell_data).write(path)
    return path


def error(field):
    return np.abs(wrap(field.theta + edge_angle(MESH) - (0.1 + 0.05 * middles(MESH).real))).max()


@pytest.mark.parametrize("suffix", ["vtu", "vtk"])
@pytest.mark.parametrize(
    "arrays, name",
    [
        ({"v": D}, None),
        ({"v": 7 * D, "pressure": PRESSURE}, None),
        ({"v": D, "w": np.ones((N, 3))}, "v"),
        ({"stress": T.reshape(N, 9)}, None),
        ({"stress": VOIGT, "v": np.ones((N, 3))}, "principal"),
        ({"stress": VOIGT, "other": VOIGT[:, ::-1]}, "stress"),
        ({"stress": VOIGT, "other": VOIGT[:, ::-1]}, "stress:principal"),
        ({"stress": PLANE, "v": np.ones((N, 3))}, "stress:principal"),
        ({"stress": T[:, :2, :2].reshape(N, 4)}, None),
        ({"a": ANGLE, "pressure": PRESSURE}, "a"),
        ({"first": D, "second": -E}, "first,second"),
        ({"first": D, "second": -E, "x:y": E}, "x:y"),
    ],
)
def test_arrays_on_points(tmp_path, suffix, arrays, name):
    if suffix == "vtk" and "x:y" in arrays:
        pytest.skip("names in these files have no colons")
    path = written(tmp_path / f"field.{suffix}", arrays)
    assert error(read_field(path, name).on(frames_of(MESH))) < 1e-3


def test_arrays_on_cells_and_on_another_mesh(tmp_path):
    constant = np.tile([0.8, 0.6, 0.0], (len(MESH.triangles), 1))
    path = written(tmp_path / "field.vtu", cell_data={"v": constant})
    target = random_square(50)
    frames = frames_of(target, scale=5.0)
    assert np.abs(wrap(read_field(path).on(frames).theta + edge_angle(target) - np.arctan2(0.6, 0.8))).max() < 1e-9
    # the array on points is preferred to the one on cells
    path = written(tmp_path / "both.vtu", {"v": D}, {"v": np.tile([0, 1.0, 0], (len(MESH.triangles), 1))})
    assert error(read_field(path).on(frames_of(MESH))) < 1e-3


def test_cells_of_second_order(tmp_path):
    points = np.concatenate([MESH.points, middles(MESH)[:, None].view(float)])
    angle = 0.1 + 0.05 * points[:, 0]
    cells = [("triangle6", np.concatenate([MESH.triangles, N + MESH.triangle_edges], axis=1))]
    d = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    path = written(tmp_path / "f.vtu", {"v": d}, cells=cells, points=np.column_stack([points, 0 * angle]))
    assert error(read_field(path).on(frames_of(MESH))) < 1e-10


@pytest.mark.parametrize(
    "arrays, name, words",
    [
        ({"v": D, "w": D}, None, "has 2 arrays of vectors or tensors: name one of its arrays: 'v', 'w'"),
        ({"pressure": PRESSURE}, None, "has no arrays of vectors or tensors: name one of its arrays: 'pressure'"),
        ({}, None, "name one of its arrays: none"),
        ({"v": D}, "u", "has no array 'u': its arrays are: 'v'"),
        ({"v": D}, "principal", "has no arrays of tensors"),
        ({"a": VOIGT, "b": VOIGT}, "principal", "has 2 arrays of tensors: name one of its arrays: 'a', 'b'"),
        ({"a": ANGLE}, "a:principal", "'a' of .* has no tensors"),
        ({"v": D, "a": ANGLE}, "v,a", "'v,a' of .* are no vectors on the same places"),
        ({"v": D}, "v,u", "has no array 'v,u'"),
        ({"v": D}, "v,v,v", "has no array 'v,v,v'"),
    ],
)
def test_arrays_that_cannot_be_meant(tmp_path, arrays, name, words):
    with pytest.raises(InputError, match=words):
        read_field(written(tmp_path / "field.vtu", arrays), name)


def test_files_that_cannot_be_used(tmp_path, capsys):
    tetrahedron = written(
        tmp_path / "solid.vtu",
        {"v": np.ones((4, 3))},
        cells=[("tetra", np.array([[0, 1, 2, 3]]))],
        points=np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    )
    nan = written(tmp_path / "nan.vtu", {"v": np.where(MESH.points[:, :1] > 3, np.nan, 1.0) * [1, 0, 0]})
    (tmp_path / "empty.vtu").touch()
    (tmp_path / "poly.vtu").write_text('<VTKFile type="PolyData" version="0.1"></VTKFile>')
    (tmp_path / "broken.vtu").write_text("<VTKFile")
    (tmp_path / "text.vtk").write_text("hello\n")
    capsys.readouterr()
    for path, kind, words in (
        (tetrahedron, FieldError, "no triangles or quadrangles"),
        (nan, FieldError, r"values of the field are no finite numbers, first at \(\d"),
        (tmp_path / "empty.vtu", FieldError, "is empty"),
        (tmp_path / "poly.vtu", FieldError, "cannot be read .*PolyData"),
        (tmp_path / "broken.vtu", FieldError, "cannot be read"),
        (tmp_path / "text.vtk", FieldError, "cannot be read"),
        (tmp_path / "none.vtu", InputError, "no such file"),
        (tmp_path, InputError, "is not a file"),
    ):
        with pytest.raises(kind, match=words) as caught:
            read_field(path)
        assert "\n" not in str(caught.value)
    assert capsys.readouterr() == ("", "")
