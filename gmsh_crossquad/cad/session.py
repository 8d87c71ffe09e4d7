"""Being a guest in somebody's Gmsh session.

Gmsh is one global state per process: options, a list of models, a current model, one mesh per model.  Whatever this
package changes there it puts back, also when it fails:

- `guest` initialises Gmsh only where nobody has and finalises only what it initialised;
- `options` sets numeric options for the time of a block;
- `scratch_model` works in a model of its own with a unique name (a second model of the same name shadows the first);
- `MeshSnapshot` keeps the mesh of the current model to put it back;
- `gmsh_errors` is the one place that turns Gmsh's bare ``Exception`` into an error of this package.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import gmsh
import numpy as np

from ..errors import MeshError
from ..records import Float, Int

__all__ = ["MeshSnapshot", "gmsh_errors", "guest", "is_running", "options", "scratch_model", "visible"]


def is_running() -> bool:
    """Whether somebody has initialised Gmsh."""
    return bool(gmsh.isInitialized())


@contextmanager
def gmsh_errors(what: str, *, entity: tuple[int, int] | None = None) -> Iterator[None]:
    """Turn a bare exception of Gmsh into a `MeshError`.

    Parameters
    ----------
    what : str
        What was being done, for example ``"meshing the curves"``.
    entity : tuple of (int, int), optional
        Dimension and tag of the entity that was worked on.

    Raises
    ------
    MeshError
        With the last error that Gmsh logged.
    """
    try:
        yield
    except Exception as error:
        if type(error) is not Exception:  # Gmsh raises nothing but bare exceptions; everything else is not its doing
            raise
        last = gmsh.logger.getLastError() if gmsh.isInitialized() else ""
        reason = " ".join((str(error) or last or "no reason given").split())
        raise MeshError(f"Gmsh failed {what} ({reason})", entity=entity) from error


@contextmanager
def options(**values: float) -> Iterator[None]:
    """Set numeric Gmsh options and put the former values back at the end.

    Parameters
    ----------
    **values : float
        Option names to values: ``options(**{"Mesh.Algorithm": 5})``.
    """
    saved: dict[str, float] = {}
    try:
        for name, value in values.items():
            saved[name] = gmsh.option.getNumber(name)
            gmsh.option.setNumber(name, value)
        yield
    finally:
        for name, value in saved.items():
            gmsh.option.setNumber(name, value)


def _make_current(name: str) -> None:
    """Make model `name` the current one if it still exists."""
    if name in gmsh.model.list() and gmsh.model.getCurrent() != name:
        gmsh.model.setCurrent(name)


@contextmanager
def guest() -> Iterator[None]:
    """A Gmsh session that looks afterwards as it did before.

    Initialises Gmsh without reading configuration files and without taking over the interrupt signal, but only if
    nobody has initialised it; finalises it only then.  Inside, Gmsh is silent.  The current model is made current
    again at the end; where the block fails, models and post-processing views that it left are removed as well.
    """
    own = not gmsh.isInitialized()
    if own:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        with options(**{"General.Terminal": 0}):
            name = gmsh.model.getCurrent()
            models = gmsh.model.list()
            views = set(gmsh.view.getTags().tolist())
            try:
                yield
            except BaseException:
                for view in gmsh.view.getTags().tolist():
                    if view not in views:
                        gmsh.view.remove(view)
                for extra in gmsh.model.list():
                    if extra not in models:
                        gmsh.model.setCurrent(extra)
                        gmsh.model.remove()
                raise
            finally:
                _make_current(name)
    finally:
        if own:
            gmsh.finalize()


@contextmanager
def scratch_model() -> Iterator[str]:
    """An empty model with a unique name, current inside the block and removed at its end.

    Yields
    ------
    str
        The name of the scratch model.
    """
    before = gmsh.model.getCurrent()
    taken = set(gmsh.model.list())
    name = next(name for name in (f"crossquad scratch {k}" for k in range(len(taken) + 1)) if name not in taken)
    gmsh.model.add(name)
    try:
        yield name
    finally:
        if name in gmsh.model.list():
            gmsh.model.setCurrent(name)
            gmsh.model.remove()
        _make_current(before)


@contextmanager
def visible(shown: set[tuple[int, int]]) -> Iterator[None]:
    """Show these entities (dim, tag) and all points of the current model only; the visibility of every entity is put back."""
    entities = gmsh.model.getEntities()
    before = [gmsh.model.getVisibility(*e) for e in entities]
    try:
        for e in entities:
            gmsh.model.setVisibility([e], int(e in shown or e[0] == 0))
        yield
    finally:
        for e, value in zip(entities, before):
            gmsh.model.setVisibility([e], value)


@dataclass(frozen=True)
class _EntityMesh:
    dim: int
    tag: int
    nodes: Int
    coordinates: Float
    parameters: Float
    element_types: tuple[int, ...]
    elements: tuple[Int, ...]
    element_nodes: tuple[Int, ...]


@dataclass(frozen=True)
class MeshSnapshot:
    """The mesh of a model: nodes (with parametric coordinates) and elements of every entity.

    Attributes
    ----------
    model : str
        Name of the model that it was taken from.
    entities : tuple
        One record per entity that has nodes or elements.
    """

    model: str
    entities: tuple[_EntityMesh, ...]

    @classmethod
    def take(cls) -> MeshSnapshot:
        """The mesh of the current model."""
        records = []
        with gmsh_errors("reading the mesh of the model"):
            meshed = len(gmsh.model.mesh.getNodes()[0]) > 0
            for dim, tag in gmsh.model.getEntities() if meshed else []:
                nodes, coordinates, _ = gmsh.model.mesh.getNodes(dim, tag)
                types, elements, element_nodes = gmsh.model.mesh.getElements(dim, tag)
                if not len(nodes) and not len(types):
                    continue
                parameters = np.zeros(0)
                if dim in (1, 2) and len(nodes) and not gmsh.model.getType(dim, tag).startswith("Discrete"):
                    parameters = gmsh.model.mesh.getNodes(dim, tag, returnParametricCoord=True)[2]
                records.append(
                    _EntityMesh(
                        dim,
                        tag,
                        np.array(nodes, np.int64),
                        np.array(coordinates),
                        np.array(parameters),
                        tuple(int(t) for t in types),
                        tuple(np.array(e, np.int64) for e in elements),
                        tuple(np.array(n, np.int64) for n in element_nodes),
                    )
                )
        return cls(gmsh.model.getCurrent(), tuple(records))

    def clear(self) -> None:
        """Take the mesh off the model, unless it is the geometry of discrete entities: it need not be kept again and again."""
        if self.entities and not any(gmsh.model.getType(*entity).startswith("Discrete") for entity in gmsh.model.getEntities()):
            gmsh.model.mesh.clear()

    def restore(self) -> None:
        """Replace the mesh of the model by the one that was taken; the current model stays current."""
        before = gmsh.model.getCurrent()
        _make_current(self.model)
        with gmsh_errors("restoring the mesh of the model"):
            gmsh.model.mesh.clear()
            for e in self.entities:
                if len(e.nodes):
                    parameters = e.parameters if len(e.parameters) == e.dim * len(e.nodes) else np.zeros(0)
                    gmsh.model.mesh.addNodes(e.dim, e.tag, e.nodes, e.coordinates, parameters)
            for e in self.entities:
                if e.element_types:
                    gmsh.model.mesh.addElements(e.dim, e.tag, e.element_types, e.elements, e.element_nodes)
        _make_current(before)
