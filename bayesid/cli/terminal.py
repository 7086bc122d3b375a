"""What a user sees when something goes wrong: one message and an exit code, a traceback only with -v.

Exit codes: 0 ok, 2 usage or bad input, 3 not converged or a check failed, 4 a mistake in the log, 1 a fault
of the program or a killed worker, 130 stopped by the user, 143 by the system.
"""

from __future__ import annotations

import errno
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import typer

from bayesid.cli import stopping
from bayesid.errors import BayesidError
from bayesid.lock import release_all
from bayesid.progress import set_quiet, silence, tell

# a disk that is full, over quota, read-only or broken
FULL = (errno.ENOSPC, errno.EDQUOT)
DISK = (*FULL, errno.EFBIG, errno.EROFS, errno.EIO)
STDOUT = "standard output cannot be written"
OK, FAULT, BAD_INPUT, NOT_CONVERGED, WRONG_LOG, INTERRUPTED = 0, 1, 2, 3, 4, 130

# ClickException, which older releases of typer take from click and newer ones bring along
_Usage: Any = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")
_verbose = False


def set_verbose(on: bool) -> bool:
    """Remember that tracebacks are wanted; usable as the callback of an option."""
    global _verbose
    _verbose = _verbose or on
    return on


def guarded(command: Callable[[], Any], args: Sequence[str] | None = None) -> int:
    """Run a command tree and return its exit code; nothing is raised but SystemExit by the interpreter."""
    global _verbose
    _verbose = False
    set_quiet(False)
    show_before, warnings.showwarning = warnings.showwarning, _show_warning
    try:
        given = sys.argv[1:] if args is None else list(args)
        code = command().main(args=given, prog_name="bayesid", standalone_mode=False)
        sys.stdout.flush()
        # newer releases of typer turn Ctrl-C into an exit code, and a library may have dropped it on the way
        if code == INTERRUPTED or stopping.asked():
            raise KeyboardInterrupt
        return code if isinstance(code, int) else OK
    except _Usage as error:
        error.show()
        return BAD_INPUT
    except BayesidError as error:
        return _refuse(str(error), error.exit_code)
    except (typer.Abort, KeyboardInterrupt):
        return _refuse(stopping.text(), stopping.code())
    except BrokenPipeError:  # `bayesid ... | head`: the reader has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except OSError as error:
        return _refuse(_os_message(error), BAD_INPUT)
    except MemoryError:
        return _refuse("out of memory; use fewer samples, runs or starts at a time", FAULT)
    except Exception as error:
        text = f"unexpected {type(error).__name__}: {error}\nThis is a fault of bayesid, not of your data."
        return _refuse(text, FAULT, hint=True)
    finally:
        release_all()
        warnings.showwarning = show_before


def _refuse(message: str, code: int, hint: bool = False) -> int:
    if stopping.asked():
        message, code, hint = stopping.text(), stopping.code(), False
    if _verbose:
        traceback.print_exc()
    elif hint:
        message += " Run the command again with -v for details to report."
    tell(f"bayesid: {message}")
    return code


def _os_message(error: OSError) -> str:
    reason = error.strerror or str(error) or type(error).__name__
    place = error.filename
    if place is None and error.errno in DISK:
        place = _failed_output() or _file_at_work(error)
    if error.errno in FULL and place != STDOUT:
        reason += "; make room there, or give --out a folder elsewhere"
    return f"{place}: {reason}" if place is not None else reason


def _file_at_work(error: OSError) -> str | None:
    """The file that was written by whoever raised: of a full disk the system tells no name."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    for frame in reversed(frames):
        for name in ("filepath", "filename", "path", "target"):
            value = frame.f_locals.get(name)
            if isinstance(value, str | os.PathLike) and os.path.isabs(value):
                return str(value)
    return None


def _failed_output() -> str | None:
    """The name of standard output where that is what cannot be written: errors of a stream carry no name."""
    try:
        print(flush=True)  # an empty line: what failed is no longer in the buffer
    except (OSError, ValueError):
        silence(sys.stdout)
        return STDOUT
    return None


def _show_warning(message: Any, category: Any, filename: str, lineno: int, *_: Any, **__: Any) -> None:
    if not _verbose and str(message).startswith("Glyph "):  # a figure shows a box; names elsewhere are whole
        return
    place = f" ({category.__name__}, {filename}:{lineno})" if _verbose else ""
    tell(f"warning: {message}{place}")
