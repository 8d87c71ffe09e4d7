import subprocess
import sys

import meshio
import numpy as np
import pytest
from matplotlib.image import imread

from gmsh_crossquad.errors import InputError
from gmsh_crossquad.view import picture as module
from gmsh_crossquad.view.scene import build_scene
from tests.results import NX, NY, hand_made


def pixels(path):
    return imread(path)[..., :3]


def test_scene_of_a_plane_model_keeps_x_and_y():
    scene = build_scene(hand_made())
    np.testing.assert_allclose(scene.extent, [[0, 0], [2, 1]], atol=1e-12)
    field, layout, mesh = scene.panels
    assert "1 singularities of +¼, 0 of −¼" in field.title
    assert "4 blocks" in layout.title
    assert f"{4 * NX * NY} quads" in mesh.title
    assert len(mesh.cells) == 4 * NX * NY


def test_crosses_sit_on_a_grid_inside_the_faces():
    result = hand_made()
    arms = build_scene(result).panels[0].lines[0].segments
    middle = arms.mean(axis=1)
    cell = 2 / 30
    np.testing.assert_allclose(middle[:, :2] / cell % 1.0, 0.5, atol=1e-9)
    assert len(arms) == 2 * 30 * 15  # two arms at every grid point
    # the crosses of the hand-made field follow the axes
    direction = arms[:, 1] - arms[:, 0]
    np.testing.assert_allclose(np.abs(direction[:, :2]).min(axis=1), 0.0, atol=1e-9)


def test_neighbouring_blocks_differ_in_colour():
    result = hand_made()
    colours = build_scene(result).panels[1].colours
    block = result.mesh.quad_block
    tint = {b: tuple(colours[block == b][0]) for b in range(4)}
    assert tint[0] != tint[1] and tint[0] != tint[2] and tint[1] != tint[3] and tint[2] != tint[3]


@pytest.mark.parametrize("library", ["vtk", "matplotlib"])
def test_picture(tmp_path, monkeypatch, library):
    if library == "matplotlib":
        monkeypatch.setattr(module, "_draw_with_vtk", lambda scene, path: "crashes with signal 11")
    else:
        reason = module._draw_with_vtk(build_scene(hand_made()), tmp_path / "probe.png")
        if reason.startswith("crashes"):
            pytest.skip(f"VTK cannot render on this machine: it {reason}")
        assert reason == ""
        (tmp_path / "probe.png").unlink()
        monkeypatch.setitem(sys.modules, "matplotlib.figure", None)  # no stepping in
    path = tmp_path / "a.png"
    hand_made().picture(path)
    image = pixels(path)
    assert image.shape[0] > 300 and image.shape[1] > 300
    assert 0.05 < (image.min(axis=2) < 0.98).mean() < 0.95  # neither blank nor full
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_no_library_to_draw_with(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_draw_with_vtk", lambda scene, path: "crashes with signal 11")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(InputError, match="signal 11: install matplotlib"):
        hand_made().picture(tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


def test_crash_of_the_drawing_process_is_noticed(tmp_path, monkeypatch):
    def crash(command, **_):
        return subprocess.CompletedProcess(command, -11, b"", b"")

    monkeypatch.setattr(module.subprocess, "run", crash)
    assert module._draw_with_vtk(build_scene(hand_made()), tmp_path / "a.png") == "crashes with signal 11"


def test_picture_wants_png(tmp_path):
    with pytest.raises(InputError, match=r"unknown picture format '\.gif'"):
        hand_made().picture(tmp_path / "a.gif")


def test_vtu_holds_mesh_layout_field_and_singularities(tmp_path):
    path = tmp_path / "a.vtu"
    hand_made().write_vtu(path)
    mesh = meshio.read(path)
    cells = {c.type: c.data for c in mesh.cells}
    data = {n: {c.type: d for c, d in zip(mesh.cells, v, strict=True)} for n, v in mesh.cell_data.items()}
    assert len(cells["quad"]) == 4 * NX * NY
    assert sorted(np.bincount(data["block"]["quad"])) == [NX * NY] * 4
    np.testing.assert_allclose(data["scaled_jacobian"]["quad"], 1.0)
    # every layout edge is a chain of mesh edges: 6 along x with NX, 6 along y with NY edges
    assert len(cells["line"]) == 6 * NX + 6 * NY
    assert len(np.unique(data["layout_edge"]["line"])) == 12
    arm = data["cross_1"]["triangle"]
    np.testing.assert_allclose(np.abs(arm).max(axis=1), 1.0, atol=1e-12)  # the crosses follow the axes
    np.testing.assert_allclose(np.einsum("mc,mc->m", arm, data["cross_2"]["triangle"]), 0.0, atol=1e-12)
    np.testing.assert_allclose(mesh.points[cells["vertex"][0, 0]], [0.5, 0.5, 0.0], atol=1e-12)
    assert data["index"]["vertex"].tolist() == [1]
    assert [p.name for p in tmp_path.iterdir()] == ["a.vtu"]
