"""Real ships' logs by `import` alone, against the bundles written by hand; the logs are not part of the
project."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesid.trials import load_trial
from bayesid.trials.importing import apply_map, propose, write_bundle

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
BUNDLES = Path(__file__).resolve().parents[1] / "studies" / "real_logs"
#: what the bundle says beyond the log: rates of a filter that lags are replaced by the unfiltered ones
CHOSEN = {"kvlcc2_hsva": {}, "esso_osaka": {"u": "u_raw[m/s]", "v": "v_raw[m/s]", "r": "r_gyro[rad/s]"}}


@pytest.mark.skipif(not DATA.is_dir(), reason="the logs are not part of the project")
@pytest.mark.parametrize("name", CHOSEN)
def test_a_proposed_map_gives_the_runs_of_the_bundle_written_by_hand(tmp_path, name):
    wanted = load_trial(BUNDLES / name, DATA / name)
    files = [DATA / name / "runs" / f"{run.name}.csv" for run in wanted.runs]
    found = propose(files).map
    assert found.questions == ()  # a position held for 2.6 of 210 s is remarked upon
    assert found.rudder_positive == wanted.rudder_positive
    channels = {k: replace(v, source=CHOSEN[name].get(k, v.source)) for k, v in found.channels.items()}
    found = replace(found, channels=channels)
    runs, origin = apply_map(found, files)
    write_bundle(found, runs, origin, tmp_path, None)
    got = {run.name: run for run in load_trial(tmp_path).runs}
    for run in wanted.runs:
        for group in ("data", "commands", "measured_inputs", "exogenous", "propulsion"):
            theirs = getattr(got[run.name], group)
            assert set(theirs) == set(getattr(run, group))
            for key, values in getattr(run, group).items():
                np.testing.assert_array_equal(theirs[key], values, err_msg=f"{run.name} {key}")
