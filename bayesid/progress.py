"""Progress on the terminal for studies and commands: a live bar for people, few plain lines for log files.

Takes stage names and step counts. Writes to stderr only, so that stdout stays the command's answer.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable, Iterator, Sequence, Sized
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, TextIO, TypeVar

from bayesid.errors import BayesidError

T = TypeVar("T")
_silent = False


def set_quiet(on: bool) -> bool:
    """Whether all progress of this process is silent; usable as the callback of an option."""
    global _silent
    _silent = bool(on)
    return on


def printable(text: str) -> str:
    """Text without control characters, which in a name out of a file could steer the terminal."""
    return "".join(c if c in "\n\t" or c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


def tell(text: str, stream: TextIO | None = None) -> None:
    """A line on the terminal; where it cannot be written, as on a full disk, work goes on in silence."""
    to = stream or sys.stderr
    try:
        print(printable(text), file=to, flush=True)
    except OSError:
        silence(to)


def silence(stream: TextIO) -> None:
    """What is written to it goes nowhere from now on: what its buffer holds is then no error at the end."""
    with suppress(OSError, ValueError), open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), stream.fileno())


class Progress:
    """Progress of a sequence of stages.

    On a terminal a bar with time left; elsewhere one line when a stage ends and, in long stages, one every
    `every` seconds. Quiet if `quiet`. Not shared between threads.
    """

    def __init__(self, *, quiet: bool = False, every: float = 10.0, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._quiet = quiet or _silent
        self._every = every
        self._bars: _Bars | None = None
        self._steps, self._step, self._depth = 0, 0, 0

    def expect(self, steps: int) -> None:
        """From now on the next so many stages are named step 1 of n, step 2 of n and so on."""
        self._steps, self._step = steps, 0

    def route(self, steps: Sequence[RouteStep]) -> Route:
        """A listener for work that says in sentences where it is."""
        return Route(self, steps)

    @contextmanager
    def stage(self, name: str, total: int | None = None) -> Iterator[Stage]:
        """A named piece of work of `total` steps (None: unknown); call `.step()` on what it yields."""
        if self._depth == 0 and self._step < self._steps and self._steps > 1:
            self._step += 1
            name = f"step {self._step} of {self._steps}: {name}"
        self._depth += 1
        try:
            yield from self._shown(name, total)
        finally:
            self._depth -= 1

    def _shown(self, name: str, total: int | None) -> Iterator[Stage]:
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
            tell(message, self._stream)

    def _is_terminal(self) -> bool:
        return bool(getattr(self._stream, "isatty", lambda: False)())


@dataclass(frozen=True)
class RouteStep:
    """A step of work that tells where it is in sentences.

    Attributes
    ----------
    begins : beginnings of the sentences it is told by
    share : usual share of the whole time that it takes
    varies : what makes it take longer than usual, where it may; said once when it does
    """

    begins: tuple[str, ...]
    share: float
    varies: str = ""


LATE = 1.2  # time gone over that planned to the end of a step, from which on no time left is told


class Route:
    """Sentences become lines "step k of n: sentence (12 s, about 20 s left)"; steps only go on."""

    def __init__(self, progress: Progress, steps: Sequence[RouteStep]) -> None:
        self._progress, self._steps, self._at = progress, tuple(steps), 0
        self._begin = time.monotonic()
        self._entered, self._late = 0.0, -1

    def __call__(self, sentence: str) -> None:
        """Tell one sentence."""
        gone = time.monotonic() - self._begin
        for k in range(self._at, len(self._steps)):
            if sentence.startswith(self._steps[k].begins):
                if k > self._at:
                    self._at, self._entered = k, gone
                break
        shares = [s.share / sum(s.share for s in self._steps) for s in self._steps]
        before, after, left = sum(shares[: self._at]), sum(shares[self._at + 1 :]), ""
        if before > 0.05:  # too little has gone by to tell before
            whole = self._entered / before
            if gone > LATE * whole * (1.0 - after):
                left = self._longer()
            else:
                left = f", about {time_words(max(whole - gone, whole * after))} left"
        self._progress.note(f"step {self._at + 1} of {len(self._steps)}: {sentence} ({gone:.0f} s{left})")

    def _longer(self) -> str:
        """That a step takes longer than usual, and what makes it so, the first time; then nothing."""
        if self._late == self._at:
            return ""
        self._late, why = self._at, self._steps[self._at].varies
        return ", longer than usual" + (f": {why}" if why else "")


def time_words(seconds: float) -> str:
    """A rough time: 20 s, 3 min, 2 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


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
        # the end of a stage has a line of its own
        if now - self._last >= self._every and self.done != self.total:
            self._last = now
            self._print(f"{self._count()}, {self.seconds:.0f} s{self._left()}")

    def _left(self) -> str:
        if not self.total or not 0 < self.done < self.total:
            return ""
        return f", about {time_words(self.seconds * (self.total - self.done) / self.done)} left"

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if not self.done and isinstance(error, BayesidError):  # refused; the error says what there is to say
            return
        state = "done" if kind is None else "stopped"
        count = f" {self._count()}" if self.done else ""
        self._print(f"{state}{count} in {self.seconds:.1f} s")

    def _count(self) -> str:
        return f"{self.done}/{self.total}" if self.total else str(self.done)

    def _print(self, text: str) -> None:
        note = f" ({self.info})" if self.info else ""
        tell(f"{self.name}: {text}{note}", self._stream)


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
