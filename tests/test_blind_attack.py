"""Attacks on the blind protocol that were tried: what holds, and what the score says of what does not.

The account is in docs/developer/blind_attack.md. Attacks that `test_blind_protocol` tries are not repeated.
"""

# ruff: noqa: F811 (fixtures of the protocol's own tests)
from __future__ import annotations

import json
import os

import numpy as np
import pytest
from test_blind_protocol import answer, commit_again, original, score, world  # noqa: F401

from bayesid.benchmark.protocol.commitment import (
    PACK_COMMITMENTS_FILE,
    VERDICT_COMMITMENT_FILE,
    BlindError,
    digest_of_file,
    digest_of_folder,
)
from bayesid.benchmark.protocol.leak_check import check_pack
from bayesid.benchmark.protocol.make_pack import commit_pack, write_answer
from bayesid.benchmark.protocol.report import blind_report


@pytest.mark.thorough
@pytest.mark.parametrize("place, text, said", [
    ("trial.toml", "# it was the tide\n", "pond/trial.toml: holds comments"),
    ("vehicle.toml", "x = 1 # it was the tide\n", "pond/vehicle.toml: holds comments"),
    ("trial.toml", 'secretly = "tide"\n', "pond/trial.toml: holds 'secretly'"),
])  # fmt: skip
def test_a_comment_or_a_key_no_diagnosis_reads_is_refused(world, place, text, said):
    file = world / "pack" / "pond" / place
    file.write_text(text + file.read_text())
    with pytest.raises(BlindError, match=said):
        check_pack(world / "pack")


def test_a_covariance_copied_from_a_fit_that_knew_the_answer_is_refused(world):
    """Its narrow directions would say which coefficients were re-tuned, and how."""
    place = world / "pack" / "pond"
    np.savez(place / "vehicle.covariance.npz", names=np.array(["Y_v"]), covariance=np.eye(1))
    toml = (place / "vehicle.toml").read_text()
    (place / "vehicle.toml").write_text(toml + '\n[prior]\ncovariance = "vehicle.covariance.npz"\n')
    with pytest.raises(BlindError, match=r"pond/vehicle.covariance.npz: may hold an answer"):
        check_pack(world / "pack")


def test_a_number_sign_within_a_text_is_no_comment(world):
    toml = world / "pack" / "pond" / "trial.toml"
    toml.write_text(toml.read_text().replace('manoeuvre = "', 'manoeuvre = "# 2 ', 1))
    with pytest.raises(BlindError) as caught:
        check_pack(world / "pack")
    assert "changed after the pack was committed" in str(caught.value)
    assert "comment" not in str(caught.value)


def test_a_bundle_swapped_together_with_its_commitment_is_noticed_by_the_makers_copy(world):
    """The solver edits a log and writes its digest into the pack: only the answers side knows better."""
    run = next((world / "pack" / "pond").glob("*.csv"))
    run.write_text(run.read_text().rstrip("\n").rsplit("\n", 1)[0] + "\n")
    told = json.loads((world / "pack" / PACK_COMMITMENTS_FILE).read_text())
    told["bundles"]["pond"]["bundle"] = digest_of_folder(world / "pack" / "pond")
    (world / "pack" / PACK_COMMITMENTS_FILE).write_text(json.dumps(told))
    check_pack(world / "pack")  # nothing to see from here
    commitment = json.loads((world / "out" / VERDICT_COMMITMENT_FILE).read_text())
    commit_again(world, pack=commitment["pack"] | {"commitments": told})
    with pytest.raises(BlindError, match="the verdicts answer other commitments"):
        score(world)


def test_the_seal_of_other_verdicts_fits_neither_other_verdicts_nor_another_pack(world):
    """A commitment copied beside verdicts it was not made for, or replayed for a later pack."""
    path = world / "out" / "pond" / "diagnosis.json"
    kept = path.read_bytes()
    path.write_bytes(kept.replace(b'"none"', b'"outside"', 1))
    with pytest.raises(BlindError, match="pond: the verdict was changed"):
        score(world)
    path.write_bytes(kept)
    write_answer(world / "answers" / "pond.json", answer("pond"))  # the next pack: same name, another salt
    commit_pack(world / "pack", world / "answers", ["pond"])
    with pytest.raises(BlindError, match="pond: the answer is not the one that was committed"):
        score(world)


def test_a_verdict_written_after_the_answers_were_opened_for_a_bundle_listed_as_failed_is_refused(world):
    commitment = json.loads((world / "out" / VERDICT_COMMITMENT_FILE).read_text())
    commit_again(world, verdicts={}, failures={"pond": "no verdict"}, pack=commitment["pack"])
    with pytest.raises(BlindError, match="pond: a verdict was added after the commitment"):
        score(world)


def test_what_is_solved_is_left_out_when_it_is_listed_as_not_solved_and_the_score_says_so(world):
    """What the protocol cannot prevent: a solver who drops the bundles it doubts."""
    commitment = json.loads((world / "out" / VERDICT_COMMITMENT_FILE).read_text())
    names = dict.fromkeys(("pond", "lake"), commitment["pack"]["bundles"]["pond"])
    told = commitment["pack"]["commitments"]
    write_answer(world / "answers" / "lake.json", answer("lake"))
    told["bundles"]["lake"] = {"answer": digest_of_file(world / "answers" / "lake.json"), "bundle": ""}
    (world / "answers" / PACK_COMMITMENTS_FILE).write_text(json.dumps(told))
    commit_again(world, unsolved=["lake"], pack={"bundles": names, "commitments": told})
    sheet = score(world)
    assert sheet.missing == ("lake",)
    assert "left out, whatever" in blind_report(sheet).lead


def test_times_of_the_files_of_a_pack_are_one_time(world):
    """A bundle with a cause takes longer to make than one without: the gaps between files told which."""
    os.utime(world / "pack" / "pond" / "trial.toml", (1, 1))
    commit_pack(world / "pack", world / "answers", ["pond"])
    times = {p.stat().st_mtime_ns for p in (world / "pack").rglob("*")}
    assert len(times) == 1 and min(times) > 10**18


def test_a_pack_solved_as_a_plain_folder_is_noticed(world):
    commitment = json.loads((world / "out" / VERDICT_COMMITMENT_FILE).read_text())
    commit_again(world, pack=commitment["pack"] | {"commitments": None})
    with pytest.raises(BlindError, match="the verdicts answer other commitments"):
        score(world)
    (world / "answers" / PACK_COMMITMENTS_FILE).unlink()
    assert "had no commitments" in score(world).caveats[0]
