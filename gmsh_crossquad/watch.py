"""Seconds and work per run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

__all__ = ["Watch"]


@dataclass
class Watch:
    """Seconds per stage, a listener that is told when a stage starts, and the work so far: guide quads that were smoothed.

    Work, unlike time, is the same in every run; what is tried next may depend on it.
    """

    listener: Callable[[str], None] | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    work: int = 0

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a block of code under `name`."""
        if self.listener is not None:
            self.listener(name)
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
