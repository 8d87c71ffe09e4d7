"""The command `gmsh-crossquad`: `mesh` makes a quad mesh of a model, `field` its cross field alone, `check` judges a mesh.

This process parses the arguments and checks the paths; the work is done in a child process (see `child`).  A file appears
under its name only when all of it is written; whatever was there before stays if anything fails.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from . import __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from .progress import Display

__all__ = ["field_task", "main", "mesh_task"]

PROGRAM = "gmsh-crossquad"


class _Parser(argparse.ArgumentParser):
    """Reports a usage error on one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{PROGRAM}: error: {' '.join(message.split())} (see {self.prog} --help)\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog=PROGRAM, description="Block-structured pure-quad meshes of Gmsh models from cross fields.")
    parser.add_argument("--version", action="version", version=f"{PROGRAM} {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=_Parser)

    mesh = commands.add_parser(
        "mesh", help="mesh the surfaces of a model", description="Mesh the surfaces of a model with quads."
    )
    mesh.add_argument("model", help="model that Gmsh opens: .geo, .step, .brep, .msh with geometry, ...")
    mesh.add_argument("-o", "--output", required=True, help="mesh file; the format goes by the extension (.msh, .vtu, .inp, ...)")
    mesh.add_argument("--size", type=float, metavar="H", help="target edge length (default: the sizes of the model)")
    mesh.add_argument("--max-quads", type=int, metavar="N", help="refuse to make more quads than this (default: 10000000)")
    mesh.add_argument("--block-size", type=float, metavar="F", help="wanted block edge over the size (default: 4)")
    mesh.add_argument("--order", type=int, metavar="P", help="order of the elements, 1 to 3 (default: Mesh.ElementOrder)")
    mesh.add_argument(
        "--incomplete",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="quads of order 2 with 8 nodes, not 9 (default: Mesh.SecondOrderIncomplete)",
    )
    follow = mesh.add_mutually_exclusive_group()
    follow.add_argument(
        "--feature-angle",
        type=float,
        metavar="DEGREES",
        help="do not follow curves across which the normals of faces differ by less (default: every curve is followed)",
    )
    follow.add_argument(
        "--respect-all-curves",
        action="store_const",
        const=0.0,
        dest="feature_angle",
        help="follow every curve, whatever angle the model sets",
    )
    mesh.add_argument(
        "--extrude",
        metavar="LENGTH:LAYERS",
        help="sweep a plane model into hexahedra along its normal (or DX,DY,DZ:LAYERS along a vector)",
    )
    mesh.add_argument("--picture", metavar="PNG", help="draw cross field, block layout and mesh")
    mesh.add_argument("--vtu", metavar="VTU", help="write mesh, layout and field for ParaView")

    field = commands.add_parser(
        "field",
        help="make the aligned cross field of a model",
        description="Write the aligned cross field of a model, with its singularities, as Gmsh views or for ParaView.",
    )
    field.add_argument("model", help="model that Gmsh opens")
    field.add_argument("-o", "--output", required=True, help="field file: .msh (Gmsh views) or .vtu")
    field.add_argument("--picture", metavar="PNG", help="draw the given and the aligned field")

    for command in (mesh, field):
        command.add_argument(
            "--field",
            metavar="SOURCE",
            help="cross field: smooth (default), singularities:(X,Y[,Z]):Q,..., eigenmode:K, curvature (principal directions), "
            "heat-frame (frame of the vector heat method; heat-frame:MODULE:FUNCTION for angles to it), FILE[:ARRAY], "
            "MODULE:FUNCTION, view:TAG (or 1=SOURCE;2=SOURCE, by surface)",
        )
        command.add_argument(
            "--index",
            action="append",
            metavar="POINT[@SURFACE]=I",
            help="index of a singular point, e.g. 7=1/4 or 7@2=-1/4 (may be repeated)",
        )
        command.add_argument(
            "--fix-indices", action="store_true", default=None, help="change indices that do not fit together, as few as possible"
        )
        command.add_argument(
            "--relax",
            action=argparse.BooleanOptionalAction,
            default=None,
            help="move singular points so that the flux around holes vanishes (default: only if nothing else gives a layout)",
        )

    check = commands.add_parser(
        "check", help="judge a mesh", description="Print the quality of a mesh; exit status 1 if it is bad."
    )
    check.add_argument("mesh", help="mesh file that Gmsh reads")
    check.add_argument("--feature-angle", type=float, metavar="DEGREES", help="as it was given to mesh")
    check.add_argument("--model", help="the model that it is a mesh of: compare boundary, area and groups too")

    for command in (mesh, field, check):
        loudness = command.add_mutually_exclusive_group()
        loudness.add_argument("--quiet", action="store_true", help="print nothing but errors")
        loudness.add_argument("--verbose", action="store_true", help="print every stage, and tracebacks")
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    argv : list of str, optional
        Arguments; default those of the process.

    Returns
    -------
    int
        Exit status: 0 done, 1 no mesh (or a bad one), 2 wrong usage, 3 a model that cannot be meshed, 130 interrupted.
    """
    try:
        arguments = _parser().parse_args(argv)
    except SystemExit as end:
        return int(end.code or 0)
    from .errors import CrossQuadError

    verbose = bool(arguments.verbose)
    try:
        signal.signal(signal.SIGTERM, _terminate)
        status = {"mesh": _mesh, "field": _field, "check": _check}[arguments.command](arguments)
        sys.stdout.flush()
        return status
    except CrossQuadError as error:
        details = getattr(error, "details", "")
        if verbose and details:
            print(details, end="", file=sys.stderr)
        return _fail(str(error), error.exit_status)
    except KeyboardInterrupt:
        return _fail("interrupted", 130)
    except BrokenPipeError:  # the reader of our output has gone, as in `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as error:
        if verbose:
            import traceback

            traceback.print_exc()
        return _fail(f"internal error: {type(error).__name__}: {error}: run again with --verbose and report it", 1)


def _terminate(_signal: int, _frame: object) -> NoReturn:
    raise KeyboardInterrupt


def _fail(message: str, status: int) -> int:
    with suppress(OSError):
        print(f"{PROGRAM}: error: {' '.join(message.split())}", file=sys.stderr, flush=True)
    return status


def _display(arguments: argparse.Namespace) -> Display:
    from .progress import Display

    return Display(quiet=arguments.quiet, verbose=arguments.verbose)


def _mesh(arguments: argparse.Namespace) -> int:
    from .arguments import parse_extrusion
    from .formats import MESH_FORMATS, VOLUME_FORMATS

    sweep = parse_extrusion(arguments.extrude) if arguments.extrude is not None else None
    names = "size", "max_quads", "block_size", "order", "incomplete", "feature_angle", "field", "fix_indices", "relax"
    values = _options(arguments, names)
    formats = MESH_FORMATS if sweep is None else VOLUME_FORMATS
    answer = _run_with_outputs("cli:mesh_task", arguments, values, formats, extrude=sweep)
    if not arguments.quiet:
        _print_outcome(arguments, answer)
    return 0


def _field(arguments: argparse.Namespace) -> int:
    from .progress import print_timings

    values = _options(arguments, ("field", "fix_indices", "relax"))
    answer = _run_with_outputs("cli:field_task", arguments, values, (".msh", ".vtu"))
    if not arguments.quiet:
        print_timings(answer["timings"])
        for line in answer["faces"]:
            print(line)
        for note in answer["notes"]:
            print(f"note: {note}")
    return 0


def _options(arguments: argparse.Namespace, names: tuple[str, ...]) -> dict[str, Any]:
    """The options that were given, checked."""
    from .arguments import check_options
    from .errors import InputError

    values = {name: getattr(arguments, name) for name in names}
    values = {name: value for name, value in values.items() if value is not None}
    indices = []
    for text in arguments.index or ():
        point, equals, value = text.partition("=")
        point, at, face = point.partition("@")
        try:
            indices.append([int(point), int(face) if at else None, value.strip()])
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"the index {text!r} is none", remedy="write POINT=1/4, or POINT@SURFACE=1/4")
    if indices:
        values["boundary_index"] = indices
    check_options(**_decoded(values))
    return values


def _decoded(values: dict[str, Any]) -> dict[str, Any]:
    """Options as `mesh` takes them from what went through JSON."""
    if "boundary_index" not in values:
        return values
    pairs = {point if face is None else (point, face): index for point, face, index in values["boundary_index"]}
    return {**values, "boundary_index": pairs}


def _run_with_outputs(
    task: str, arguments: argparse.Namespace, values: dict[str, Any], formats: tuple[str, ...], **more: Any
) -> Any:
    """Run a task in the child; its files get their names when all of them are complete."""
    from .child import run
    from .errors import InputError
    from .formats import PICTURE_FORMATS, check_input, check_output, check_suffix, temporary_beside

    check_input(arguments.model)
    wanted = {"output": (arguments.output, formats, arguments.command)}
    if arguments.picture:
        wanted["picture"] = (arguments.picture, PICTURE_FORMATS, "picture")
    if getattr(arguments, "vtu", None):
        wanted["vtu"] = (arguments.vtu, (".vtu",), "ParaView")
    for path, allowed, what in wanted.values():
        check_suffix(path, allowed, what)
    places = {kind: check_output(path) for kind, (path, _, _) in wanted.items()}
    if Path(os.path.realpath(arguments.model)) in places.values():
        raise InputError(f"the output {arguments.output!r} is the model itself", remedy="choose another name")
    if len(set(places.values())) < len(places):
        raise InputError("two outputs have the same name", remedy="choose another name for one")
    unfinished = {kind: temporary_beside(place) for kind, place in places.items()}
    job = {"model": arguments.model, "options": values, "verbose": arguments.verbose, **more}
    job |= {kind: str(path) for kind, path in unfinished.items()}
    try:
        answer = run(task, job, _display(arguments))
        for kind, place in places.items():
            if place.exists():
                shutil.copymode(place, unfinished[kind])
            os.replace(unfinished[kind], place)
    finally:
        for path in unfinished.values():
            path.unlink(missing_ok=True)
    return answer


def _print_outcome(arguments: argparse.Namespace, answer: dict[str, Any]) -> None:
    from .progress import print_timings

    print_timings(answer["timings"])
    for note in answer["notes"]:
        print(f"note: {note}")
    q = answer["quality"]
    blocks = "1 block" if q["blocks"] == 1 else f"{q['blocks']} blocks"
    quads = "quads" if answer["order"] == 1 else f"quads of order {answer['order']}"
    print(
        f"{arguments.output}: {q['quads']} {quads} in {blocks}, scaled Jacobian min {q['min_scaled_jacobian']:.3f} "
        f"mean {q['mean_scaled_jacobian']:.3f}, {q['irregular']} irregular vertices"
        + (f"; {answer['hexahedra']} hexahedra" if answer["hexahedra"] else "")
    )


class _Stages:
    """Tells of stages as they start, and times them."""

    def __init__(self, emit: Callable[[str], None]) -> None:
        self._emit = emit
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        self._emit(name)
        start = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - start


def mesh_task(job: dict[str, Any], emit: Callable[[str], None]) -> dict[str, Any]:
    """The work of ``gmsh-crossquad mesh``, in the child process."""
    from dataclasses import asdict

    stage = _Stages(emit)
    with stage("start"):
        from .cad.files import open_model, write_mesh
        from .cad.session import guest
    with guest():
        with stage("open"):  # first of all: most mistakes show here
            open_model(job["model"])
        with stage("load"):
            from .api import mesh
            from .cad.high_order import element_order
            from .formats import check_order
            from .options import MeshOptions
        given = job["options"].get
        sweep = job["extrude"]
        check_order(job["output"], *element_order(given("order"), given("incomplete")), volumes=sweep is not None)
        result = mesh(progress=emit, **_decoded(job["options"]))
        stage.seconds |= result.timings
        with stage("measure"):
            quality = asdict(result.quality)
        hexahedra = 0
        if sweep is not None:
            with stage("extrude"):
                hexahedra = result.extrude(*sweep, most=given("max_quads", MeshOptions.max_quads)).hexahedra
        with stage("write"):
            write_mesh(job["output"])
        if "vtu" in job:
            with stage("vtu"):
                result.write_vtu(job["vtu"])
        if "picture" in job:
            with stage("picture"):
                result.picture(job["picture"])
    return {
        "quality": quality,
        "order": result.order,
        "hexahedra": hexahedra,
        "notes": list(result.notes),
        "timings": stage.seconds,
    }


def field_task(job: dict[str, Any], emit: Callable[[str], None]) -> dict[str, Any]:
    """The work of ``gmsh-crossquad field``, in the child process."""
    stage = _Stages(emit)
    with stage("start"):
        from .cad.files import open_model
        from .cad.session import guest
    with guest():
        with stage("open"):
            open_model(job["model"])
        with stage("load"):
            from .api import cross_field
        result = cross_field(progress=emit, **_decoded(job["options"]))
        stage.seconds |= result.timings
        with stage("write"):
            result.write(job["output"])
        if "picture" in job:
            with stage("picture"):
                result.picture(job["picture"])
    return {"faces": [f.summary for f in result.faces], "notes": list(result.notes), "timings": stage.seconds}


def _check(arguments: argparse.Namespace) -> int:
    from .arguments import check_options
    from .child import run
    from .formats import check_input

    check_input(arguments.mesh)
    if arguments.model:
        check_input(arguments.model)
    job = {"mesh": arguments.mesh, "model": arguments.model, "verbose": arguments.verbose}
    job["feature_angle"] = check_options(feature_angle=arguments.feature_angle).feature_angle
    answer = run("judge:check_task", job, _display(arguments))
    if not arguments.quiet:
        print(answer["table"])
    return 1 if answer["faults"] else 0


if __name__ == "__main__":
    sys.exit(main())
