"""A chain that is interrupted: killed, out of disk space, damaged; it goes on as if nothing had happened."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from gaussian_density import correlated

from bayesid.errors import SampleError
from bayesid.estimation.sampling import SamplerOptions, sample

HERE = Path(__file__).parent
OPTIONS = SamplerOptions(
    ensembles=4, walkers=16, first=40, max_steps=600, seed=11, weights={"stretch": 0.8, "gaussian": 0.2}
)
SCRIPT = """
import resource, sys, time
import numpy as np
sys.path.insert(0, sys.argv[1])
from gaussian_density import correlated
from test_sampler_resume import OPTIONS
from bayesid.errors import SampleError
from bayesid.estimation.sampling import sample
density, laplace = correlated(5)
plain = density.log_prob
density.log_prob = lambda q: (time.sleep(float(sys.argv[3])), plain(q))[1]
if sys.argv[4] != "0":  # no file may become longer: what a full disk does, without needing one
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[4]), resource.RLIM_INFINITY))
try:
    sample(density, laplace, OPTIONS, sys.argv[2])
except SampleError as error:
    print(error)
    sys.exit(2)
"""


def command(folder, pause, limit=0):
    return [sys.executable, "-W", "ignore", "-c", SCRIPT, str(HERE), str(folder), str(pause), str(limit)]


@pytest.fixture(scope="module")
def unbroken():
    return sample(*correlated(5), OPTIONS)


def rounds(folder):
    return sorted(p.name for p in (folder / "chain").glob("round*.h5"))


@pytest.mark.thorough
def test_a_chain_killed_in_the_middle_and_resumed_is_the_unbroken_chain(tmp_path, unbroken):
    process = subprocess.Popen(command(tmp_path, 0.003))
    until = time.monotonic() + 60
    while len(rounds(tmp_path)) < 3 and process.poll() is None and time.monotonic() < until:
        time.sleep(0.01)
    assert process.poll() is None, "it ended before it could be killed"
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    kept = rounds(tmp_path)
    assert not (tmp_path / "posterior.nc").exists()
    found = sample(*correlated(5), OPTIONS, tmp_path, resume=True)
    assert rounds(tmp_path)[: len(kept)] == kept and len(rounds(tmp_path)) > len(kept)
    assert np.array_equal(found.draws, unbroken.draws)
    assert np.array_equal(found.log_prob, unbroken.log_prob)
    assert found.counts == unbroken.counts


def test_a_stop_within_the_density_prints_nothing_of_the_sampler_and_loses_nothing(tmp_path, unbroken, capfd):
    """emcee prints a traceback and its arrays for whatever is raised within the density."""
    density, laplace = correlated(5)
    plain, calls = density.log_prob, []

    def asked(q):
        calls.append(len(q))
        if len(calls) == 300:
            raise KeyboardInterrupt
        return plain(q)

    density.log_prob = asked
    with pytest.raises(KeyboardInterrupt):
        sample(density, laplace, OPTIONS, tmp_path)
    assert len(calls) == 300 and capfd.readouterr() == ("", "")
    found = sample(*correlated(5), OPTIONS, tmp_path, resume=True)
    assert np.array_equal(found.draws, unbroken.draws)


def test_another_seed_gives_another_chain(unbroken):
    from dataclasses import replace

    other = sample(*correlated(5), replace(OPTIONS, seed=12))
    assert not np.array_equal(other.draws[:, 0], unbroken.draws[:, 0])


@pytest.mark.thorough
def test_a_full_disk_is_said_and_costs_nothing_that_was_written(tmp_path, unbroken):
    ended = subprocess.run(command(tmp_path, 0, 45_000), capture_output=True, text=True, timeout=120)
    assert ended.returncode == 2, ended.stderr
    assert "cannot be written" in ended.stdout and "make room and resume" in ended.stdout
    kept = rounds(tmp_path)
    assert kept, "the limit is below the first round: nothing was tested"
    assert not list((tmp_path / "chain").glob(".*"))
    found = sample(*correlated(5), OPTIONS, tmp_path, resume=True)
    assert np.array_equal(found.draws, unbroken.draws)


def test_a_chain_is_not_taken_for_another_ones(tmp_path):
    from dataclasses import replace

    short = replace(OPTIONS, max_steps=50)
    sample(*correlated(5), short, tmp_path)
    with pytest.raises(SampleError, match="holds a chain already"):
        sample(*correlated(5), short, tmp_path)
    with pytest.raises(SampleError, match="made with another seed"):
        sample(*correlated(5), replace(short, seed=1), tmp_path, resume=True)
    with pytest.raises(SampleError, match="another start"):
        sample(*correlated(5, seed=2), short, tmp_path, resume=True)
    longer = sample(*correlated(5), OPTIONS, tmp_path, resume=True)  # only the end is further away
    assert longer.steps > 50
    (tmp_path / "chain" / "round001.h5").write_bytes(b"damaged")
    with pytest.raises(SampleError, match=r"round001\.h5 is damaged"):
        sample(*correlated(5), OPTIONS, tmp_path, resume=True)


def test_a_round_of_another_chain_or_of_another_density_is_not_resumed(tmp_path):
    from dataclasses import replace

    import h5py

    short = replace(OPTIONS, max_steps=50)
    for name, seed in (("a", OPTIONS.seed), ("b", 1)):
        sample(*correlated(5), replace(short, seed=seed), tmp_path / name)
    rounds = sorted((tmp_path / "a" / "chain").glob("*.h5"))
    own = rounds[-1].read_bytes()
    rounds[-1].write_bytes((tmp_path / "b" / "chain" / rounds[-1].name).read_bytes())
    with pytest.raises(SampleError, match=rf"{rounds[-1].name} is of another chain"):
        sample(*correlated(5), OPTIONS, tmp_path / "a", resume=True)
    rounds[-1].write_bytes(own)
    with h5py.File(rounds[-1], "a") as file:
        file["log_prob"][-1, 0, 3] += 0.01
    with pytest.raises(SampleError, match=r"tells log density .* where it is"):
        sample(*correlated(5), OPTIONS, tmp_path / "a", resume=True)
