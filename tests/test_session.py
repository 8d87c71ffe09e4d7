"""The user's Gmsh session looks afterwards as it did before."""

import gmsh
import numpy as np
import pytest

from gmsh_crossquad.cad.session import MeshSnapshot, gmsh_errors, guest, is_running, options, scratch_model
from gmsh_crossquad.errors import GeometryError, MeshError


@pytest.fixture
def session():
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield
    gmsh.finalize()


def square(name="square"):
    gmsh.model.add(name)
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()


def test_guest_initialises_and_finalises_only_its_own():
    assert not is_running()
    with guest():
        assert is_running()
        with guest():
            pass
        assert is_running()
    assert not is_running()


def test_guest_finalises_after_an_error():
    with pytest.raises(ZeroDivisionError), guest():
        raise ZeroDivisionError
    assert not is_running()


def test_guest_restores_terminal_and_current_model(session):
    gmsh.option.setNumber("General.Terminal", 1)
    square("mine")
    with guest():
        assert gmsh.option.getNumber("General.Terminal") == 0
        gmsh.model.add("other")
    assert gmsh.option.getNumber("General.Terminal") == 1
    assert gmsh.model.getCurrent() == "mine"
    gmsh.option.setNumber("General.Terminal", 0)


def test_guest_removes_what_a_failure_leaves(session):
    square("mine")
    views = gmsh.view.getTags().tolist()
    with pytest.raises(KeyError), guest():
        gmsh.model.add("left over")
        gmsh.view.add("left over")
        raise KeyError
    assert "left over" not in gmsh.model.list()
    assert gmsh.view.getTags().tolist() == views
    assert gmsh.model.getCurrent() == "mine"


@pytest.mark.parametrize("fail", [False, True])
def test_options_are_restored(session, fail):
    before = gmsh.option.getNumber("Mesh.Algorithm"), gmsh.option.getNumber("Mesh.MeshSizeMax")
    try:
        with options(**{"Mesh.Algorithm": 5, "Mesh.MeshSizeMax": 0.5}):
            assert gmsh.option.getNumber("Mesh.Algorithm") == 5
            assert gmsh.option.getNumber("Mesh.MeshSizeMax") == 0.5
            if fail:
                raise ValueError
    except ValueError:
        pass
    assert (gmsh.option.getNumber("Mesh.Algorithm"), gmsh.option.getNumber("Mesh.MeshSizeMax")) == before


def test_an_unknown_option_changes_none(session):
    before = gmsh.option.getNumber("Mesh.Algorithm")
    with pytest.raises(Exception, match="NoSuchOption"), options(**{"Mesh.Algorithm": 5, "Mesh.NoSuchOption": 1}):
        pass
    assert gmsh.option.getNumber("Mesh.Algorithm") == before


@pytest.mark.parametrize("fail", [False, True])
def test_scratch_model_leaves_no_trace(session, fail):
    square("mine")
    models = gmsh.model.list()
    try:
        with scratch_model() as name:
            assert gmsh.model.getCurrent() == name
            assert gmsh.model.getEntities() == []
            square("in between")
            gmsh.model.remove()
            if fail:
                raise ValueError
    except ValueError:
        pass
    assert gmsh.model.list() == models
    assert gmsh.model.getCurrent() == "mine"
    assert len(gmsh.model.getEntities(2)) == 1


def test_scratch_models_nest_with_different_names(session):
    square("mine")
    with scratch_model() as outer:
        with scratch_model() as inner:
            assert inner != outer
        assert gmsh.model.getCurrent() == outer


def entity_mesh():
    out = {}
    for dim, tag in gmsh.model.getEntities():
        nodes, xyz, _ = gmsh.model.mesh.getNodes(dim, tag)
        parameters = gmsh.model.mesh.getNodes(dim, tag, returnParametricCoord=True)[2] if dim in (1, 2) else []
        types, tags, connected = gmsh.model.mesh.getElements(dim, tag)
        out[dim, tag] = [np.array(a) for a in (nodes, xyz, parameters, types, *tags, *connected)]
    return out


@pytest.mark.parametrize("order", [1, 2])
def test_snapshot_restores_the_mesh(session, order):
    square()
    point = gmsh.model.occ.addPoint(0.3, 0.3, 0)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.embed(0, [point], 2, 1)
    gmsh.model.addPhysicalGroup(2, [1], name="plate")
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.setOrder(order)
    before = entity_mesh()
    snapshot = MeshSnapshot.take()
    gmsh.model.mesh.clear()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.05)
    gmsh.model.mesh.generate(2)
    snapshot.restore()
    after = entity_mesh()
    assert before.keys() == after.keys()
    for key, arrays in before.items():
        assert len(arrays) == len(after[key])
        for a, b in zip(arrays, after[key]):
            np.testing.assert_array_equal(a, b)
    assert gmsh.model.mesh.getEmbedded(2, 1) == [(0, point)]
    assert gmsh.model.getPhysicalName(2, 1) == "plate"


def test_snapshot_of_an_unmeshed_model_clears(session):
    square()
    snapshot = MeshSnapshot.take()
    gmsh.model.mesh.generate(2)
    snapshot.restore()
    assert len(gmsh.model.mesh.getNodes()[0]) == 0


def test_snapshot_restores_its_own_model(session):
    square("mine")
    gmsh.model.mesh.generate(2)
    count = len(gmsh.model.mesh.getNodes()[0])
    snapshot = MeshSnapshot.take()
    gmsh.model.mesh.clear()
    square("other")
    snapshot.restore()
    assert gmsh.model.getCurrent() == "other"
    assert len(gmsh.model.mesh.getNodes()[0]) == 0
    gmsh.model.setCurrent("mine")
    assert len(gmsh.model.mesh.getNodes()[0]) == count


def test_errors_of_gmsh_become_mesh_errors(session):
    with (
        pytest.raises(MeshError, match=r"Gmsh failed evaluating .*surface 77") as caught,
        gmsh_errors("evaluating", entity=(2, 77)),
    ):
        gmsh.model.getNormal(77, [0.0, 0.0])
    assert caught.value.entity == (2, 77)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("error", [GeometryError("as it is"), ValueError("not Gmsh's")])
def test_other_errors_pass(session, error):
    with pytest.raises(type(error)) as caught, gmsh_errors("doing something"):
        raise error
    assert caught.value is error
