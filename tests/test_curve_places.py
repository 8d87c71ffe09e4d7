"""Nodes on curves that the CAD has off its faces."""

from __future__ import annotations

from dataclasses import dataclass

import gmsh
import numpy as np
import pytest

from gmsh_crossquad.cad.curve_places import CurvePlaces
from gmsh_crossquad.cad.put import curve_points
from gmsh_crossquad.records import Curve, Face, Float, Int, Model

OFF = 3e-4
T = np.linspace(0.0, 1.0, 9)


@dataclass(frozen=True)
class Tilted:
    """Planes through `origins` (f, 3) with unit normals `across` (f, 3)."""

    origins: Float
    across: Float

    @property
    def curved(self) -> Float:
        return np.zeros(len(self.origins), bool)

    def feet(self, face: Int, points: Float) -> Float:
        height = np.einsum("nc,nc->n", points - self.origins[face], self.across[face])
        return points - height[:, None] * self.across[face]

    def normals(self, face: Int, points: Float) -> Float:
        return self.across[face]


pytestmark = pytest.mark.usefixtures("fresh_gmsh")


def bent_edge(uses: int, embedded: bool = False, off: float = OFF) -> Model:
    """The x axis from 0 to 2 as a spline that leaves it by `off` in y and in z, bounding the first `uses` of two faces."""
    geo = gmsh.model.geo
    ends = [geo.addPoint(0, 0, 0), geo.addPoint(2, 0, 0)]
    tag = geo.addSpline([ends[0], geo.addPoint(1, off, off), ends[1]])
    geo.synchronize()
    points = gmsh.model.getValue(1, tag, T).reshape(-1, 3)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    curve = Curve(tag, 0, 1, points, T, along)
    loops = [((((0, 1),),) if f < uses and not embedded else ()) for f in range(2)]
    inside = (0,) if embedded else ()
    faces = tuple(Face(f + 1, np.zeros(3), np.eye(3), loops[f], inside if f == 0 else ()) for f in range(2))
    return Model("", np.zeros(3), 1.0, np.array(ends), points[[0, -1]], np.zeros(2, bool), (curve,), faces)


def planes(angle: float, gap: float = 0.0) -> Tilted:
    """z = 0, and a plane through the x axis at `angle` to it that is shifted by `gap` across itself."""
    across = np.array([[0.0, 0.0, 1.0], [0.0, -np.sin(angle), np.cos(angle)]])
    return Tilted(np.array([np.zeros(3), gap * across[1]]), across)


@pytest.mark.parametrize("angle", [0.15, 1.2, np.pi / 2, 2.9])
def test_nodes_come_onto_both_planes(angle):
    model = bent_edge(2)
    places = CurvePlaces.find(model, planes(angle))
    assert places.faces == ((0, 1),)
    exact, got = curve_points(model, 0, T), places(0, T)
    assert np.abs(exact[:, 1:]).max() > 0.9 * OFF
    assert np.abs(got[:, 1:]).max() < 1e-11  # the line in which the planes meet
    assert np.allclose(got[:, 0], exact[:, 0], rtol=0, atol=1e-12)  # by the shortest way


@pytest.mark.parametrize(("uses", "embedded", "off"), [(1, False, OFF), (2, False, 1e-6)])
def test_boundaries_and_curves_close_to_their_faces_stay(uses, embedded, off):
    model = bent_edge(uses, embedded, off)
    places = CurvePlaces.find(model, planes(1.0))
    assert places.faces == ((),)
    assert np.array_equal(places(0, T), curve_points(model, 0, T))


def test_a_curve_on_one_of_its_faces_stays():
    model = bent_edge(2)
    bisector = np.array([0.0, 1.0, -1.0]) / np.sqrt(2)  # the plane of the spline
    assert CurvePlaces.find(model, Tilted(np.zeros((2, 3)), np.array([bisector, [0.0, 0.0, 1.0]]))).faces == ((),)


def test_an_embedded_curve_comes_onto_its_face():
    model = bent_edge(0, embedded=True)
    got = CurvePlaces.find(model, planes(1.0))(0, T)
    assert np.abs(got[:, 2]).max() < 1e-12
    assert np.allclose(got[:, :2], curve_points(model, 0, T)[:, :2], rtol=0, atol=1e-15)


def test_between_parallel_faces_nodes_take_the_middle():
    model = bent_edge(2)
    places = CurvePlaces.find(model, planes(0.0, gap=-OFF))  # no point is on both; the curve is outside both
    assert places.faces == ((0, 1),)
    got, exact = places(0, T), curve_points(model, 0, T)
    assert np.allclose(got[1:-1, 2], -OFF / 2, rtol=0, atol=1e-12)
    assert np.allclose(got[1:-1, :2], exact[1:-1, :2], rtol=0, atol=1e-12)


def test_nodes_stay_where_the_faces_meet_far_away():
    model = bent_edge(2)
    places = CurvePlaces.find(model, planes(0.2, gap=2 * OFF))  # ten times as far as the curve is off
    assert places.faces == ((0, 1),)
    assert np.array_equal(places(0, T), curve_points(model, 0, T))
