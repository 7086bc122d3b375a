"""Are conventions of two published ship logs found where they are read wrongly on purpose?

Usage: python -m studies.log_mistakes.real_logs --data FOLDER [--out FILE]. The logs are kept elsewhere.
Esso Osaka counts the rudder positive to starboard and logs orders; the raw files of KVLCC2 hold velocities
north and east beside those along and across. Each is read as somebody would who had not read that, and judged
as `bayesid diagnose` does before it looks for a gap. One line per log is written as it is judged.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from bayesid.diagnosis.input import check_trial
from bayesid.equations.model import build_model
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import load_trial
from studies.log_mistakes.plant import logged, planted

LOGS = Path(__file__).parents[1] / "real_logs"
NOTHING = "nothing"
SHARED = (NOTHING, "sign of delta_r", "sign of v", "x and y exchanged")
ROWS = {
    "esso_osaka": (*SHARED, "order logged as measured"),
    "kvlcc2_hsva": (*SHARED, "earth-fixed velocities"),
}


def study(data: Path, out: Path) -> None:
    """Judge every row that `out` does not hold yet."""
    done = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    known = {(row["log"], row["mistake"]) for row in done}
    mistakes = {row.name: row for row in planted()}
    for name, rows in ROWS.items():
        if all((name, row) in known for row in rows):
            continue
        trial = load_trial(LOGS / name, data)
        model = build_model(load_vehicle(LOGS / name / "vehicle.toml"), 3)
        for row in rows:
            if (name, row) in known:
                continue
            read = trial if row == NOTHING else logged(trial, mistakes[row], 0)
            found = check_trial(read, model).findings
            names = [f.name for f in found]
            right = not found if row == NOTHING else bool(found) and found[0].name in mistakes[row].right
            said = {
                "log": name, "mistake": row, "named": names, "right": right,
                "also": list(found[0].also) if found else [], "mend": list(found[0].mend) if found else [],
            }  # fmt: skip
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(said) + "\n")
            print(f"{name}, {row}: {', '.join(names) or 'nothing'}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=Path("out/log_mistakes_real.jsonl"))
    given = parser.parse_args()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    study(given.data, given.out)
