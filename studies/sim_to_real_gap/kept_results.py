"""Results that took minutes, kept as they are made: a study that was killed goes on with the next one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bayesid.files import write_json


def keep(store: Path, name: str, make: Callable[[], Any]) -> Any:
    """What `make` gives, as plain data; read back where an earlier call has written it."""
    path = store / f"{name}.json"
    if not path.exists():
        write_json(path, make())
    return json.loads(path.read_text(encoding="utf-8"))
