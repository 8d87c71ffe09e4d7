"""What a user sees while a mesh is made, and how long each stage took.

`Display` is told of every stage when it starts, and draws a bar on a terminal once a stage has run for more than a second;
`print_timings` is the table at the end.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from typing import IO, Any

__all__ = ["Display", "print_timings", "timing_table"]


class Display:
    """Shows the stages on a stream: a bar on a terminal for slow stages, a line per stage when `verbose`.

    Parameters
    ----------
    stream : text file
    quiet, verbose : bool
    patience : float
        Seconds that a stage may run before the bar appears.
    """

    def __init__(self, stream: IO[str] | None = None, quiet: bool = False, verbose: bool = False, patience: float = 1.0) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._quiet, self._verbose, self._patience = quiet, verbose, patience
        self._begin = time.perf_counter()
        self._bar: Any = None
        self._task: Any = None
        self.stage = ""

    def start(self, stage: str) -> None:
        """A stage has started."""
        self.stage, self._begin = stage, time.perf_counter()
        if self._bar is not None:
            self._bar.update(self._task, description=stage)
        if self._verbose and not self._quiet:
            print(f"gmsh-crossquad: {stage}", file=self._stream, flush=True)

    def tick(self) -> None:
        """Some time has passed: bring up the bar where the stage is slow."""
        slow = time.perf_counter() - self._begin > self._patience
        if self._quiet or self._verbose or self._bar is not None or not self._stream.isatty() or not slow:
            return
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(bar_width=30), TimeElapsedColumn())
        self._bar = Progress(*columns, console=Console(file=self._stream), transient=True)
        self._task = self._bar.add_task(self.stage, total=None)
        self._bar.start()

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def timing_table(timings: Mapping[str, float]) -> str:
    """The stages and their seconds as plain lines, the sum last."""
    rows = [*timings.items(), ("total", sum(timings.values()))]
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"  {name:<{width}}  {seconds:7.3f} s" for name, seconds in rows)


def print_timings(timings: Mapping[str, float]) -> None:
    """Print the stages and their seconds: as a table on a terminal, else as plain lines."""
    if not sys.stdout.isatty():
        print(timing_table(timings))
        return
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table("stage", box=SIMPLE_HEAD, show_footer=True)
    table.columns[0].footer = "total"
    table.add_column("seconds", justify="right", footer=f"{sum(timings.values()):.3f}")
    for name, seconds in timings.items():
        table.add_row(name, f"{seconds:.3f}")
    Console().print(table)
