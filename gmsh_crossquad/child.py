"""Running a task in a child process, so that a crash of native code costs nothing but one line.

The child sends what happens as lines of JSON through a pipe: ``{"stage": name}`` when a stage starts and, last, ``{"result":
...}`` or ``{"error": ..., "status": ...}``.  A child that ends without a last word has crashed; the signal and the stage say
where.  Where the system can fork, the child is forked before anything heavy is imported and costs nothing; elsewhere the
module runs itself in a new interpreter.  Both standard streams of the child go nowhere (unless `verbose`): the CAD kernel
writes to them behind Gmsh's back.
"""

from __future__ import annotations

import importlib
import importlib.machinery
import importlib.util
import json
import os
import select
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import IO, Any

from .errors import CrossQuadError
from .progress import Display

__all__ = ["ChildError", "run"]

_TICK = 0.25
# SciPy's ``from numpy import *`` loads these two, which nothing here uses: 0.05 s of CPU
_UNUSED = ("numpy.f2py", "numpy.testing")


class ChildError(CrossQuadError):
    """The child reported an error of its own, or crashed.

    Parameters
    ----------
    line : str
        The whole message.
    status : int
        Exit status for the command line.
    details : str
        Traceback, if any.
    """

    def __init__(self, line: str, status: int, details: str = "") -> None:
        super().__init__(line)
        self.exit_status = status
        self.details = details


def run(task: str, job: dict[str, Any], display: Display) -> Any:
    """Run ``task(job, emit)`` in a child process.

    Parameters
    ----------
    task : str
        ``"module:function"`` inside this package.
    job : dict
        Anything that JSON can hold; ``job["verbose"]`` leaves the standard streams open.
    display : Display
        Shown the stages.

    Returns
    -------
    object
        What the task returned, through JSON.

    Raises
    ------
    ChildError
        If the task failed or the child crashed.
    """
    pid, process, reader = _fork(task, job) if hasattr(os, "fork") else _spawn(task, job)
    ended = False
    answer: dict[str, Any] = {}
    try:
        for event in _events(reader, display):
            if "stage" in event:
                display.start(event["stage"])
            else:
                answer = event
        code = _wait(pid, process)
        ended = True
    finally:
        display.close()
        reader.close()
        if not ended:  # interrupted: the child must not go on alone
            with suppress(OSError):
                os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))
            _wait(pid, process)
    if "result" in answer:
        return answer["result"]
    if "error" in answer:
        raise ChildError(answer["error"], answer["status"], answer.get("details", ""))
    raise ChildError(_last_words(code, display.stage), 1)


def _last_words(code: int, stage: str) -> str:
    doing = f" in the stage {stage!r}" if stage else ""
    if code >= 0:
        return f"Gmsh ended the process with status {code}{doing}: try another size, or simplify the model there"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    if name == "SIGKILL":
        return f"the mesher was killed{doing}: there may be too little memory, try a larger size"
    return f"Gmsh crashed with signal {name}{doing}: try another size, or simplify the model there"


def _events(reader: IO[bytes], display: Display) -> Iterator[dict[str, Any]]:
    """The child's events as they come; the display ticks in between (where pipes can be waited for)."""
    buffer = b""
    while True:
        if os.name == "posix" and not select.select([reader], [], [], _TICK)[0]:
            display.tick()
            continue
        data = os.read(reader.fileno(), 65536)
        if not data:
            return
        *lines, buffer = (buffer + data).split(b"\n")
        for line in lines:
            yield json.loads(line)


def _fork(task: str, job: dict[str, Any]) -> tuple[int, None, IO[bytes]]:
    sys.stdout.flush()
    sys.stderr.flush()
    parent = os.getpid()
    r, w = os.pipe()
    pid = os.fork()
    if pid == 0:
        status = 1
        try:
            os.close(r)
            _die_with(parent)
            _serve(task, job, w)
            status = 0
        finally:
            os._exit(status)  # no interpreter shut-down: nothing in this copy of the parent is worth tidying up
    os.close(w)
    return pid, None, os.fdopen(r, "rb", buffering=0)


def _spawn(task: str, job: dict[str, Any]) -> tuple[int, subprocess.Popen[bytes], IO[bytes]]:
    command = [sys.executable, "-m", __name__, task, json.dumps(job)]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, bufsize=0)
    assert process.stdout is not None
    return process.pid, process, process.stdout


def _wait(pid: int, process: subprocess.Popen[bytes] | None) -> int:
    """Exit status of the child, minus the signal's number where one ended it."""
    if process is not None:
        return process.wait()
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def _die_with(parent: int) -> None:
    """End this process when its parent ends, however that happens (Linux only)."""
    if sys.platform != "linux":
        return
    import ctypes

    ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def _serve(task: str, job: dict[str, Any], fd: int) -> None:
    """The child's side: run the task, send its events to `fd`."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for library in ("OPENBLAS", "MKL", "OMP"):  # before NumPy is there: idle threads that spin cost 0.2 s of CPU
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    for name in _UNUSED:
        _later(name)
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(2 if job.get("verbose") else silence, 1)
    if not job.get("verbose"):
        os.dup2(silence, 2)

    def emit(event: dict[str, Any]) -> None:
        data = json.dumps(event).encode() + b"\n"
        while data:
            data = data[os.write(fd, data) :]

    try:
        module, _, name = task.partition(":")
        function: Callable[..., Any] = getattr(importlib.import_module(f".{module}", __package__), name)
        emit({"result": function(job, lambda stage: emit({"stage": stage}))})
    except CrossQuadError as error:
        emit({"error": " ".join(str(error).split()), "status": error.exit_status, "details": traceback.format_exc()})
    except MemoryError:
        emit({"error": "not enough memory: try a larger size", "status": 1, "details": traceback.format_exc()})
    except Exception as error:
        what = " ".join(f"internal error: {type(error).__name__}: {error}".split())
        emit({"error": f"{what}: run again with --verbose and report it", "status": 1, "details": traceback.format_exc()})


def _later(name: str) -> None:
    """Let a submodule be imported only when something in it is used."""
    package, _, own = name.partition(".")
    parent = importlib.import_module(package)
    spec = importlib.machinery.PathFinder.find_spec(name, parent.__path__)
    if name in sys.modules or spec is None or spec.loader is None:
        return
    spec.loader = importlib.util.LazyLoader(spec.loader)
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    setattr(parent, own, module)


if __name__ == "__main__":
    events = os.dup(1)
    _serve(sys.argv[1], json.loads(sys.argv[2]), events)
