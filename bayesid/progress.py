"""Progress on the terminal for studies and commands: a live bar for people, few plain lines for log files.

Takes stage names and step counts. Writes to stderr only, so that stdout stays the command's answer.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator, Sized
from contextlib import contextmanager
from typing import Any, TextIO, TypeVar

T = TypeVar("T")


def printable(text: str) -> str:
    """Text without control characters, which in a name out of a file could steer the terminal."""
    return "".join(c if c in "\n\t" or c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


class Progress:
    """Progress of a sequence of stages.

    On a terminal a bar with time left; elsewhere one line when a stage ends and, in long stages, one every
    `every` seconds. Quiet if `quiet`. Not shared between threads.
    """

    def __init__(self, *, quiet: bool = False, every: float = 10.0, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._quiet = quiet
        self._every = every
        self._bars: _Bars | None = None

    @contextmanager
    def stage(self, name: str, total: int | None = None) -> Iterator[Stage]:
        """A named piece of work of `total` steps (None: unknown); call `.step()` on what it yields."""
        if self._quiet:
            yield Stage(name, total)
            return
        stage: Stage
        if self._is_terminal():
            if self._bars is None or self._bars.closed:
                self._bars = _Bars(self._stream)
            stage = _BarStage(name, total, self._bars)
        else:
            stage = _LineStage(name, total, self._stream, self._every)
        with stage:
            yield stage

    def track(self, items: Iterable[T], name: str, total: int | None = None) -> Iterator[T]:
        """Pass items through while counting them as steps of a stage."""
        if total is None and isinstance(items, Sized):
            total = len(items)
        with self.stage(name, total) as stage:
            for item in items:
                yield item
                stage.step()

    def note(self, message: str) -> None:
        """One line the reader should see whatever the terminal."""
        if not self._quiet:
            print(printable(message), file=self._stream, flush=True)

    def _is_terminal(self) -> bool:
        return bool(getattr(self._stream, "isatty", lambda: False)())


class Stage:
    """Counts steps; this base shows nothing."""

    def __init__(self, name: str, total: int | None) -> None:
        self.name, self.total, self.done = name, total, 0
        self.info = ""
        self._begin = time.monotonic()

    def step(self, count: int = 1, info: str | None = None) -> None:
        """`count` steps are done; `info` replaces the short note shown beside the count."""
        self.done += count
        if info is not None:
            self.info = info
        self._show()

    @property
    def seconds(self) -> float:
        """Time since the stage began [s]."""
        return time.monotonic() - self._begin

    def _show(self) -> None:
        pass

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        pass


class _LineStage(Stage):
    def __init__(self, name: str, total: int | None, stream: TextIO, every: float) -> None:
        super().__init__(name, total)
        self._stream, self._every, self._last = stream, every, self._begin

    def _show(self) -> None:
        now = time.monotonic()
        if now - self._last >= self._every:
            self._last = now
            self._print(f"{self._count()}, {self.seconds:.0f} s")

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        state = "done" if kind is None else "stopped"
        count = f" {self._count()}" if self.done else ""
        self._print(f"{state}{count} in {self.seconds:.1f} s")

    def _count(self) -> str:
        return f"{self.done}/{self.total}" if self.total else str(self.done)

    def _print(self, text: str) -> None:
        note = f" ({self.info})" if self.info else ""
        print(printable(f"{self.name}: {text}{note}"), file=self._stream, flush=True)


class _BarStage(Stage):
    def __init__(self, name: str, total: int | None, bars: _Bars) -> None:
        super().__init__(name, total)
        self._bars = bars
        self._task = bars.add(name, total)

    def _show(self) -> None:
        self._bars.rich.update(self._task, completed=self.done, info=self.info)

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if kind is None and self.total is None:
            self._bars.rich.update(self._task, total=max(self.done, 1), completed=max(self.done, 1))
        self._bars.release()


class _Bars:
    """The bars of one terminal: nested stages share one live display."""

    def __init__(self, stream: TextIO) -> None:
        from rich import progress
        from rich.console import Console

        self.rich = progress.Progress(
            progress.SpinnerColumn(finished_text="✓"),
            progress.TextColumn("{task.description}", markup=False),
            progress.BarColumn(bar_width=28),
            progress.MofNCompleteColumn(),
            progress.TimeRemainingColumn(elapsed_when_finished=True),
            progress.TextColumn("{task.fields[info]}", markup=False),
            console=Console(file=stream),
        )
        self._users = 0
        self.closed = False

    def add(self, name: str, total: int | None) -> Any:
        if self._users == 0:
            self.rich.start()
        self._users += 1
        return self.rich.add_task(name, total=total, info="")

    def release(self) -> None:
        self._users -= 1
        if self._users == 0:
            self.rich.stop()
            self.closed = True  # a restarted display would draw over the finished bars
