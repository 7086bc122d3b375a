"""Mistakes planted into clean logs are named with the mend that undoes them; nothing else is."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from bayesid.api.simulate import simulate
from bayesid.diagnosis.input import check_trial
from bayesid.equations.model import build_model
from bayesid.errors import TrialError
from bayesid.model.vehicles import load_vehicle
from bayesid.report.input import check_record, in_order_line
from bayesid.trials import Run, Trial, load_trial, window
from bayesid.trials.consistency import check_rudder
from bayesid.trials.correction import Correction, apply, read_correction, without_effect
from bayesid.trials.health import check_runs
from bayesid.trials.kinematics.blocks import Blocks, middle
from bayesid.trials.kinematics.evidence import Relation, weigh
from bayesid.trials.kinematics.relations import relations
from bayesid.trials.mistakes import MISTAKES, check_input
from bayesid.trials.mistakes.judge import base_of, too_noisy
from bayesid.trials.mistakes.plausible import implausible
from bayesid.trials.mistakes.table import BODY_AXES, EXCHANGED
from studies.log_mistakes.harmless import harmless
from studies.log_mistakes.plant import logged

SPEED, RATE = 1.5, 0.25
COARSE = {"x": 0.42, "y": 0.42, "psi": 0.00735, "r": 0.000873, "u": 0.00708, "v": 0.00708}


def weave(seed: int = 0, n: int = 900, dt: float = 0.1, aside: float = 0.0) -> Run:
    """A track integrated from u, v, r by a midpoint rule of its own, with white noise on every channel.

    aside : speed to which the vehicle is driven to either side [m/s]
    """
    rng = np.random.default_rng(seed)
    t = dt * np.arange(n)
    phase = 2 * math.pi * rng.random()
    rudder = -np.sign(np.sin(0.4 * t + phase)) * 0.2
    r = RATE * np.sin(0.4 * t + phase - 0.9) + 0.03 * np.sin(0.11 * t)
    u = SPEED - 0.1 * np.sin(0.13 * t) ** 2
    v = -0.4 * r + aside * np.sin(0.17 * t)
    psi = 0.7 + np.concatenate(([0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * dt)))
    w = (u + 1j * v) * np.exp(1j * psi)
    place = np.concatenate(([0j], np.cumsum(0.5 * (w[1:] + w[:-1]) * dt)))
    noise = lambda s: s * rng.standard_normal(n)  # noqa: E731
    data = {
        "x": place.real + noise(0.05), "y": place.imag + noise(0.05), "psi": psi + noise(0.005),
        "u": u + noise(0.01), "v": v + noise(0.01), "r": r + noise(0.003),
    }  # fmt: skip
    return Run("weave", "", "identify", t, data, {"delta_r_cmd": rudder, "n_cmd": np.full(n, 1500.0)})


def with_noise(run: Run, **sigma: float) -> Run:
    rng = np.random.default_rng(9)
    data = {k: v + sigma.get(k, 0.0) * rng.standard_normal(v.size) for k, v in run.data.items()}
    return replace(run, data=data)


@pytest.mark.thorough
def test_a_relation_that_noise_hides_is_said_to_be_too_noisy_and_not_in_silence():
    clean, noisy = [weave(1), weave(2)], [with_noise(weave(seed), r=4.0) for seed in (1, 2)]
    check = check_input(clean)
    assert "heading against yaw rate" in check.in_order and not check.noisy
    wrong = check_input([apply(Correction(scale={"r": -1.0}), run) for run in clean])
    assert wrong.findings and not wrong.noisy
    check = check_input(noisy)
    assert "heading against yaw rate" not in check.in_order
    assert check.noisy == ("heading against yaw rate",)
    line = in_order_line(check)
    assert line.endswith("or what no mistake on the list explains: heading against yaw rate")
    assert check_record(check)["too_noisy"] == ["heading against yaw rate"]


def test_of_a_relation_that_noise_hides_in_most_runs_their_number_is_said():
    runs = [weave(1), *(replace(with_noise(weave(2), r=4.0), name=name) for name in "ab")]
    base = [base_of(run) for run in runs]
    assert too_noisy(base, frozenset()) == ("heading against yaw rate in 2 of 3 runs",)
    assert too_noisy(base, frozenset({"r"})) == ()


@pytest.mark.thorough
def test_a_right_log_has_no_mistake():
    for seed in range(5):
        assert check_input([weave(seed), weave(seed + 50)]).findings == ()


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [7, 9])
def test_a_heading_late_by_chance_alone_is_none(seed):
    # in a steady turn a delay changes only which noisy headings are compared: these were told as 10 s late
    noise = {"x": 0.3, "y": 0.3, "psi": 0.005236, "r": 0.001745, "u": 0.01, "v": 0.01}
    orders = ("zigzag:10/10", "turn:12,duration=60", "zigzag:12/12")
    clean = simulate("remus100", *orders, dt=0.01, noise=noise, seed=seed)
    assert check_input(clean.runs, travel=1.03).findings == ()


def spoilt(run: Run, rng: np.random.Generator) -> Run:
    """With one reading in a hundred off by 8 to 30 deviations, and one position in ten missing."""
    data = {name: run.data[name].copy() for name in COARSE}
    for name, values in data.items():
        hit = rng.random(values.size) < 0.01
        size = rng.choice([-1, 1], hit.sum()) * rng.uniform(8, 30, hit.sum())
        values[hit] += size * COARSE[name]
    lost = rng.random(run.n_samples) < 0.1
    data["x"][lost] = data["y"][lost] = np.nan
    return replace(run, data=data)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 5, 8, 9, 25])
def test_outliers_in_coarse_positions_are_no_delay_and_no_jump(seed):
    # each was told of a delay of seconds, a wrong sign or a jump: by outliers at the ends of blocks of a
    # straight run, where a delay moves nothing, and by an outlier in the last reading
    rng = np.random.default_rng(seed)
    orders = ("straight:duration=110", "turn:12,duration=115", "zigzag:10/10")
    clean = simulate("lauv", *orders, dt=0.25, noise=COARSE, seed=seed)
    assert check_input([spoilt(run, rng) for run in clean.runs], travel=0.674).findings == ()


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "correction"),
    [
        ("sign of psi", Correction(scale={"psi": -1.0})),
        ("sign of r", Correction(scale={"r": -1.0})),
        ("sign of y", Correction(scale={"y": -1.0})),
        ("sign of delta_r", Correction(scale={"delta_r_cmd": -1.0})),
        ("x and y exchanged", Correction(exchange=(("x", "y"),))),
        ("heading from east", Correction(heading_from="east")),
        ("u, v, w: knots read as m/s", Correction(scale={"u": 3600 / 1852, "v": 3600 / 1852})),
        ("r: degrees per second read as radians per second", Correction(scale={"r": 180 / math.pi})),
        ("psi: radians read as degrees", Correction(scale={"psi": math.pi / 180})),
        ("time in ms", Correction(time_scale=1e3)),
        ("clock", Correction(time_scale=1 / 1.2)),
        ("psi late", Correction(late={"psi": -6.0})),
        ("north of heading and position", Correction(offset={"psi": 1.2})),
        ("jump of x, y", Correction(offset={"x": 40.0}, from_time={"x": 50.0})),
        ("jump of psi", Correction(offset={"psi": 0.5}, from_time={"psi": 50.0})),
    ],
)
def test_a_planted_mistake_is_named_and_its_mend_leaves_a_right_log(name, correction):
    wrong = [apply(correction, run) for run in (weave(1), weave(2))]
    found = check_input(wrong).findings
    assert found and found[0].name == name
    mended = wrong
    for finding in found:
        mended = [apply(finding.correction, run) for run in mended]
    assert check_input(mended).findings == ()


def flips(seed: int, jump: float = 0.0, dt: float = 0.4) -> Run:
    """A small boat in a zig-zag: its rate turns over within two readings, of which one has no rate.

    jump : of the heading, amid a steady turn [rad]
    """
    rng = np.random.default_rng(seed)
    fine = 0.01 * np.arange(15001)
    side = np.where(np.floor(fine / 10.0) % 2 == 0, 1.0, -1.0)
    r = np.zeros(fine.size)
    for i in range(1, fine.size):
        r[i] = r[i - 1] + 0.01 / 0.25 * (0.5 * side[i - 1] - r[i - 1])
    psi = np.concatenate(([0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * 0.01)))
    w = 1.3 * np.exp(1j * psi)
    place = np.concatenate(([0j], np.cumsum(0.5 * (w[1:] + w[:-1]) * 0.01)))
    at = np.arange(0, fine.size, round(dt / 0.01))
    noise = lambda s: s * rng.standard_normal(at.size)  # noqa: E731
    data = {
        "x": place.real[at] + noise(0.17), "y": place.imag[at] + noise(0.17),
        "psi": psi[at] + noise(0.0034) + jump * (fine[at] > 53.0), "r": r[at] + noise(7e-4),
        "u": 1.3 + noise(0.005), "v": noise(0.005),
    }  # fmt: skip
    data["r"][np.searchsorted(fine[at], 20.0)] = np.nan
    return Run(f"r{seed}", "", "identify", fine[at], data, {"delta_r_cmd": -0.2 * side[at]})


def test_a_rate_that_turns_over_between_two_readings_is_no_jump_of_the_heading():
    """An AUV of 1.3 m read every 0.4 s was told a jump of 4 degrees, of a rate left out as an outlier."""
    assert "jump of psi" not in {f.name for f in check_input([flips(1), flips(2)]).findings}
    told = {f.name for f in check_input([flips(1, jump=0.3), flips(2)]).findings}
    assert "jump of psi" in told  # control: one amid a steady turn is


@pytest.fixture(scope="module")
def dives():
    """Runs of an AUV in six degrees of freedom that turns and dives, at 5 Hz."""
    noise = {
        "x": 0.2, "y": 0.2, "z": 0.03, "phi": 0.002, "theta": 0.002, "psi": 0.005, "u": 0.01, "v": 0.01,
        "w": 0.01, "p": 0.003, "q": 0.003, "r": 0.003,
    }  # fmt: skip
    orders = ("zigzag:10/10", "vzigzag:10/8", "turn:12,duration=60")
    return simulate("remus100", *orders, dof=6, dt=0.2, noise=noise, seed=3).runs


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "turned"),
    [("body axes forward-left-up", ("v", "r")), ("sign of v", ("v",)), ("sign of r", ("r",))],
)
def test_body_axes_of_another_convention_are_told_in_the_plane_where_the_sway_tells(name, turned):
    clean = [weave(seed, aside=0.4) for seed in (1, 2)]
    (found,) = check_input([apply(Correction(scale=dict.fromkeys(turned, -1.0)), r) for r in clean]).findings
    assert (found.name, found.also) == (name, ())
    assert check_input(clean).findings == ()


@pytest.mark.thorough
@pytest.mark.parametrize("kinematics_alone", [True, False])
def test_body_axes_of_another_convention_are_one_mistake_with_one_mend(dives, kinematics_alone):
    """They were told as a depth and a heading of the other sign."""
    turned = Correction(scale=dict.fromkeys(("v", "w", "q", "r", "theta"), -1.0))
    model = build_model(load_vehicle("remus100"), 6)

    def findings(runs):
        if kinematics_alone:
            return check_input(runs).findings
        return check_trial(Trial("dives", Path("."), "remus100", 6, tuple(runs)), model).findings

    (found,) = findings([apply(turned, run) for run in dives])
    assert found.name == "body axes forward-left-up" and found.probability > 0.99 and not found.also
    for wrong, mended in zip(
        dives, (apply(found.correction, apply(turned, run)) for run in dives), strict=True
    ):
        assert all(np.array_equal(mended.data[k], wrong.data[k], equal_nan=True) for k in wrong.data)
    assert findings(dives) == ()


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["v", "w", "q", "r", "theta", "z", "psi"])
def test_one_sign_of_a_submerged_vehicle_is_not_told_as_all_body_axes(dives, name):
    found = check_input([apply(Correction(scale={name: -1.0}), run) for run in dives]).findings
    assert "body axes forward-left-up" not in [f.name for f in found]
    assert name in ("v", "w", "z") or f"sign of {name}" in (
        found[0].name,
        *found[0].also,
    )  # faint in these runs


def test_the_mend_of_body_axes_turns_what_an_import_turns():
    from bayesid.trials.importing.axes import body_of

    names = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "u_water", "v_water", "w_water", "x", "z")
    assert {name for name in names if body_of(name, np.ones(1), "flu")[0] < 0.0} == set(BODY_AXES)


@pytest.mark.thorough
@pytest.mark.parametrize(("a", "b"), EXCHANGED)
def test_exchanged_columns_of_a_submerged_vehicle_are_named_and_not_as_something_else(dives, a, b):
    """Rates were told as a wrong unit, angles as earth-fixed velocities, each with .999."""
    pairs = ((a, b), (f"{a}_cmd", f"{b}_cmd")) if a.startswith("delta") else ((a, b),)
    wrong = [apply(Correction(exchange=pairs), run) for run in dives]
    model = build_model(load_vehicle("remus100"), 6)
    check = check_trial(Trial("dives", Path("."), "remus100", 6, tuple(wrong)), model)
    faint = (a, b) == ("v", "w")  # of this vehicle, in these runs
    assert check.findings or faint
    for finding in check.findings[:1]:
        assert f"{a} and {b} exchanged" in (finding.name, *finding.also)
    assert not check_trial(Trial("dives", Path("."), "remus100", 6, tuple(dives)), model).findings


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "delay"), [("psi", 0.6), ("psi", -0.8), ("r", 0.6), ("r", -1.0)])
def test_a_delay_of_heading_or_yaw_rate_is_told_to_a_reading(dives, name, delay):
    """A heading 0.6 s late was told as 0.8 s by the noise of which readings are compared."""
    late = [apply(Correction(late={name: -delay}), run) for run in dives]
    found = check_input(late, travel=1.03).findings
    assert found
    told = dict(found[0].correction.late)
    either = {"psi": -told["r"]} if name == "psi" and "r" in told else told
    either = {"r": -told["psi"]} if name == "r" and "psi" in told else either
    assert abs(either[name] - delay) < 0.11


@pytest.mark.thorough
def test_a_weak_rudder_is_no_exchanged_one(dives):
    """What the rudder has lost in turns is not won by taking it for the planes, moved or at rest."""
    weak = load_vehicle("remus100")
    coef = {k: v * (0.25 if k.endswith("dr") else 1.0) for k, v in weak.coef.items()}
    model = build_model(replace(weak, coef=coef), 6)
    for runs in (dives, [run for run in dives if "vzigzag" not in run.name]):
        check = check_trial(Trial("dives", Path("."), "remus100", 6, tuple(runs)), model)
        assert not any("exchanged" in text for f in check.findings for text in (f.name, *f.also))


def test_a_clock_that_is_mended_moves_the_time_a_part_of_a_run_began():
    """Effects that change with time count from there, in true seconds like the rest."""
    run = weave(1)
    late = apply(Correction(time_scale=2.0), window(run, 30.0, 80.0))
    whole = apply(Correction(time_scale=2.0), run)
    assert late.t[0] - late.began == pytest.approx(whole.t[300] - whole.t[0])
    assert apply(Correction(time_scale=2.0), run).began is None


@pytest.mark.parametrize(
    "correction",
    [
        Correction(offset={"psi": 0.09}),
        Correction(scale={"r": 1.05}),
        Correction(scale={"u": 0.95, "v": 0.95}),
        Correction(late={"u": -0.3, "v": -0.3}),
        Correction(late={"x": -0.5, "y": -0.5}),
    ],
)
def test_an_effect_of_the_catalogue_is_no_mistake(correction):
    assert check_input([apply(correction, weave(3)), apply(correction, weave(4))]).findings == ()


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["psi", "r"])
@pytest.mark.parametrize(("stride", "told"), [(1, False), (10, True)])
def test_heading_or_yaw_rate_late_by_a_sample_is_told_where_that_is_a_time(name, stride, told):
    """One reading late: 0.15 of a length at 10 Hz is what a sensor does, 1.5 lengths at 1 Hz no more."""
    runs = [every(weave(k, n=3000), stride) for k in (1, 2)]
    late = [replace(one, data={**one.data, name: np.roll(one.data[name], 1)}) for one in runs]
    late = [every_from(one, 1) for one in late]
    found = check_input(late, travel=1.0 / SPEED).findings
    assert [f.name for f in found] == ([f"{name} late"] if told else [])
    for f in found:
        assert f.correction.late[name] == pytest.approx(0.1 * stride)
        assert check_input([apply(f.correction, one) for one in late], travel=1.0 / SPEED).findings == ()


def test_a_mistake_in_one_run_is_told_of_that_run():
    runs = [replace(weave(k), name=f"r{k}") for k in range(4)]
    runs[2] = apply(Correction(scale={"psi": -1.0}), runs[2])
    found = check_input(runs).findings
    assert [(f.name, f.runs, f.all_runs) for f in found] == [("sign of psi", ("r2",), False)]


def test_slower_positions_with_empty_cells_still_tell_exchanged_axes():
    run = apply(Correction(exchange=(("x", "y"),)), weave(5))
    slow = np.arange(run.n_samples) % 10 == 3
    data = dict(run.data) | {k: np.where(slow, run.data[k], np.nan) for k in ("x", "y")}
    assert check_input([replace(run, data=data)]).findings[0].name == "x and y exchanged"


def test_a_relation_of_noise_alone_names_nothing():
    """Nothing moves but noise: no unit and no sign explains it better."""
    rng = np.random.default_rng(0)
    t = 0.1 * np.arange(600)
    data = {k: 0.01 * rng.standard_normal(600) for k in ("x", "y", "psi", "u", "v", "r")}
    run = Run("still", "", "identify", t, data, {"delta_r_cmd": np.zeros(600), "n_cmd": np.zeros(600)})
    assert [f.name for f in check_input([run, run]).findings if not f.name.startswith("dead")] == []


def test_columns_that_are_dead_are_told_together_and_are_no_rivals_of_each_other():
    """Three of them were told as "r (probability 0.33), not told from: dead u; dead v", with one left out."""
    still = {"u": 1.5, "v": 0.0, "r": 0.0}
    runs = [weave(5), weave(6)]
    dead = [
        replace(w, data={**w.data, **{k: np.full(w.n_samples, x) for k, x in still.items()}}) for w in runs
    ]
    (found,) = check_input(dead).findings
    assert found.name == "dead r, u, v" and found.also == () and found.probability > 0.999
    assert found.correction == Correction(drop=("r", "u", "v"))
    assert check_input([apply(found.correction, run) for run in dead]).findings == ()
    # control: one that is dead in the second run only is another mistake than two that are dead in both, and
    # is kept where it lives
    runs[1] = replace(runs[1], name="second")
    dead = [replace(w, data={**w.data, "u": np.full(w.n_samples, 1.5), "v": 0 * w.t}) for w in runs]
    dead[1] = replace(dead[1], data={**dead[1].data, "r": 0 * dead[1].t})
    both, other = check_input(dead).findings
    assert (both.name, both.all_runs, both.correction) == ("dead u, v", True, Correction(drop=("u", "v")))
    assert (other.name, other.runs) == ("dead r", ("second",))
    assert other.correction == Correction(drop=("r",), runs=("second",))


def test_evidence_of_a_relation_is_the_gaussian_marginal_likelihood_averaged_over_its_level():
    from scipy.stats import multivariate_normal

    from bayesid.trials.kinematics.evidence import FLOOR, LEVELS

    rng = np.random.default_rng(1)
    x, y = rng.standard_normal((2, 12))
    held = weigh(Relation("track", y, {"a": x}, {"a": 0.7}, 2.0, jacobian=0.3))
    each = [
        multivariate_normal(np.zeros(12), 0.49 * np.outer(x, x) + (2.0 * s) ** 2 * np.eye(12)).logpdf(y)
        for s in np.geomspace(FLOOR, 4.0, LEVELS)
    ]
    assert held.log_evidence == pytest.approx(np.logaddexp.reduce(each) - math.log(LEVELS) + 0.3)


def test_scaling_a_response_and_its_density_changes_no_evidence():
    run = weave(6)
    one = weigh(relations(run)["yaw"])
    data = {**run.data, "psi": 3.0 * run.data["psi"], "r": 3.0 * run.data["r"]}
    other = weigh(relations(replace(run, data=data), {"psi": 3.0})["yaw"])
    # the columns' deviations are in rates over the time of turning, which is three times as short
    assert other.log_evidence == pytest.approx(one.log_evidence, abs=2.0)
    assert other.level == pytest.approx(one.level, rel=1e-6)


@pytest.mark.parametrize("mistake", [m for m in MISTAKES if m.correction is not None], ids=lambda m: m.name)
def test_every_mend_is_read_back_from_its_line_of_trial_toml(mistake, tmp_path):
    run = weave(7, n=60)
    columns = {"t[s]": run.t, **{f"{k}[{u}]": run.data[k] for k, u in UNITS.items()},
        "delta_r_cmd[rad]": run.commands["delta_r_cmd"], "n_cmd[rpm]": run.commands["n_cmd"]}  # fmt: skip
    rows = [",".join(columns)] + [
        ",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True)
    ]
    (tmp_path / "r.csv").write_text("\n".join(rows) + "\n")
    head = 'format = 1\nname = "n"\nvehicle = "remus100"\n'
    lines = "[corrections]\n" + "\n".join(mistake.correction.lines()) + "\n"
    (tmp_path / "trial.toml").write_text(head + lines + '[[runs]]\nfile = "r.csv"\nrole = "identify"\n')
    if without_effect(mistake.correction, [run]):
        with pytest.raises(TrialError, match="changes nothing: no run logs"):
            load_trial(tmp_path)
        return
    read = load_trial(tmp_path).runs[0]
    wanted = apply(mistake.correction, run)
    for name, values in {**wanted.data, **wanted.commands}.items():
        np.testing.assert_allclose({**read.data, **read.commands}[name], values, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(read.t, wanted.t, rtol=1e-5)


UNITS = {"x": "m", "y": "m", "psi": "rad", "u": "m/s", "v": "m/s", "r": "rad/s"}


def test_a_correction_that_cannot_be_read_is_refused_with_every_reason(tmp_path):
    (tmp_path / "trial.toml").write_text(
        'format = 1\nname = "n"\n[corrections]\nscale = { uu = 2 }\nexchange = ["x"]\ntime_scale = 0\n'
        "foo = 1\n"
        'runs = ["nowhere"]\n[[runs]]\nfile = "r.csv"\n'
    )
    with pytest.raises(TrialError) as error:
        load_trial(tmp_path)
    text = str(error.value)
    assert all(word in text for word in ("'uu'", "exchange", "time_scale", "'foo'", "nowhere"))


def test_degrees_read_as_radians_are_not_unwrapped_away():
    from bayesid.trials.assemble import unwrap

    degrees = np.cumsum(np.full(200, 5.0))
    assert np.array_equal(unwrap(degrees), degrees)
    wrapped = np.mod(np.deg2rad(degrees), 2 * math.pi)
    assert np.allclose(np.diff(unwrap(wrapped)), np.deg2rad(5.0))


def stuck(run: Run, name: str, first: int, count: int) -> Run:
    values = run.data[name].copy()
    values[first : first + count] = values[first]
    return replace(run, data={**run.data, name: values})


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["psi", "r", "x", "u"])
def test_a_column_frozen_for_seconds_is_named_and_its_repeats_left_out(name):
    runs = [stuck(weave(1), name, 300, 60), replace(weave(2), name="whole")]
    found = check_input(runs).findings
    assert [f.name for f in found] == [f"frozen {name}"]
    mended = apply(found[0].correction, runs[0])
    empty = np.flatnonzero(np.isnan(mended.data[name]))
    assert set(range(301, 360)) <= set(empty) and empty.size < 62
    assert apply(found[0].correction, runs[1]) is runs[1]
    assert check_input([mended, runs[1]]).findings == ()


def test_a_track_frozen_beside_a_heading_alone_is_named():
    runs = [stuck(stuck(weave(k), "x", 300, 60), "y", 300, 60) for k in (1, 2)]
    pose = [replace(run, data={k: run.data[k] for k in ("x", "y", "psi")}) for run in runs]
    assert [f.name for f in check_input(pose).findings] == ["frozen x, y"]


def test_columns_that_freeze_together_are_one_mistake_and_apart_are_two():
    together = stuck(stuck(weave(), "x", 300, 60), "y", 305, 60)
    (found,) = check_input([together]).findings
    assert found.name == "frozen x, y" and found.probability > 0.99 and not found.also
    assert found.correction.skip_repeats == ("x", "y")
    apart = stuck(stuck(weave(), "x", 300, 60), "r", 600, 60)
    assert [f.name for f in check_input([apart]).findings] == ["frozen x", "frozen r"]
    beside = stuck(together, "r", 600, 60)
    assert {f.name for f in check_input([beside]).findings} == {"frozen x, y", "frozen r"}


def test_columns_that_froze_together_are_one_mistake_where_one_of_them_is_not_seen_in_every_run():
    """A column that comes back near to where it froze does not leap out of it: x and y at 1 Hz."""
    runs = [stuck(stuck(weave(k), "x", 300, 60), "y", 300, 60) for k in (1, 2)]
    back = runs[1].data["y"].copy()
    back[360:] += back[359] - back[360] + 1e-3
    runs[1] = replace(runs[1], name="back", data={**runs[1].data, "y": back})
    (found,) = check_input(runs).findings
    assert found.name == "frozen x, y" and found.correction.runs == ()


def test_a_short_freeze_within_a_long_one_is_another_mistake():
    run = stuck(stuck(weave(), "x", 300, 200), "r", 380, 40)
    assert {f.name for f in check_input([run]).findings} == {"frozen x", "frozen r"}


def test_degrees_of_the_heading_alone_share_no_probability_with_degrees_of_all_angles():
    """A planar log has no other angle: the two are one mistake, which stood at .499 each."""
    run = weave()
    degrees = replace(run, data=run.data | {"psi": np.degrees(run.data["psi"])})
    (found,) = check_input([degrees]).findings
    assert found.name == "psi: degrees read as radians"
    assert found.probability > 0.99 and not found.also


def test_a_held_a_saturated_and_a_resting_column_are_not_frozen():
    slow = weave(1)
    held = replace(slow, data={**slow.data, "psi": np.repeat(slow.data["psi"][::10], 10)})
    cut = replace(slow, data={**slow.data, "r": np.clip(slow.data["r"], -0.2, 0.2)})
    rest = replace(slow, data={k: np.where(slow.t < 8.0, v[80], v) for k, v in slow.data.items()})
    for run in (held, cut, rest):
        assert not [f for f in check_input([run]).findings if f.name.startswith("frozen")]
    # a log rounded so coarsely that a fifth of its readings repeat
    rounded = replace(slow, data={**slow.data, "psi": np.round(slow.data["psi"], 2)})
    assert not [f for f in check_input([rounded]).findings if f.name.startswith("frozen")]


def test_skip_repeats_is_read_from_the_file():
    problems: list[str] = []
    read = read_correction({"skip_repeats": ["psi"]}, problems)
    assert read == Correction(skip_repeats=("psi",)) and not problems
    assert read.lines() == ('skip_repeats = ["psi"]',)
    read_correction({"skip_repeats": ["heading!"]}, problems)
    assert len(problems) == 1


def test_the_quick_median_is_that_of_numpy_and_none_of_nothing():
    rng = np.random.default_rng(0)
    for n in range(1, 8):
        values = rng.standard_normal(n)
        assert middle(values) == np.median(values)
    assert math.isnan(middle(np.zeros(0)))


def test_integrals_are_those_of_a_cubic_spline_and_beat_the_trapezoid_rule():
    t = np.arange(0.0, 60.0, 1.0)
    rate = 2 * math.pi / 8.0  # eight readings a swing
    signal = np.sin(rate * t)
    blocks = Blocks(t, np.ones(t.size, bool), np.ones(t.size, bool), 12, 2)
    spline = CubicSpline(t, signal, bc_type=((1, _end(signal[:3])), (1, -_end(signal[:-4:-1]))))
    got = blocks.integral(signal)
    between = [(t[a], t[b]) for a, b in zip(blocks.first, blocks.last, strict=True)]
    np.testing.assert_allclose(got, [spline.integrate(a, b) for a, b in between], atol=1e-12)
    exact = np.array([(math.cos(rate * a) - math.cos(rate * b)) / rate for a, b in between])
    by_lines = [np.trapezoid(signal[a : b + 1]) for a, b in zip(blocks.first, blocks.last, strict=True)]
    inner = slice(1, -1)
    assert np.abs(got - exact)[inner].max() < 0.1 * np.abs(by_lines - exact)[inner].max()


def _end(first: np.ndarray) -> float:
    """Slope of a parabola through three readings one second apart, at the first."""
    return float(-1.5 * first[0] + 2.0 * first[1] - 0.5 * first[2])


@pytest.mark.parametrize("percent", [0.0, 10.0])
def test_a_clock_that_is_fast_is_named_at_eight_readings_a_swing(percent):
    wrong = [apply(Correction(time_scale=1 + percent / 100), every(weave(k, n=6000), 20)) for k in (1, 2)]
    found = check_input(wrong).findings
    assert [f.name for f in found] == (["clock"] if percent else [])
    for f in found:
        assert f.correction.time_scale == pytest.approx(1 / (1 + percent / 100), abs=0.01)


def every(run: Run, stride: int) -> Run:
    groups = {g: {k: v[::stride] for k, v in getattr(run, g).items()} for g in run.GROUPS}
    return replace(run, t=run.t[::stride], **groups)


def every_from(run: Run, first: int) -> Run:
    groups = {g: {k: v[first:] for k, v in getattr(run, g).items()} for g in run.GROUPS}
    return replace(run, t=run.t[first:], **groups)


def test_channels_a_mend_leaves_alone_are_as_plausible_as_before():
    """By hand: the whole run is looked at anew."""
    units = {"r": 180 / math.pi, "u": 100.0, "psi": 60.0, "x": 1e5, "delta_r_cmd": 0.05, "n_cmd": 60.0}
    wrong = [weave(1), *(apply(Correction(scale={k: f}), weave(1)) for k, f in units.items())]
    wrong.append(apply(Correction(time_scale=1e-3), weave(1)))
    assert len({implausible(run) for run in wrong}) > 5
    for run in wrong:
        for mistake in MISTAKES:
            fixed = apply(mistake.correction, run)
            assert implausible(fixed, mistake.correction.channels, implausible(run)) == implausible(fixed)


def steered(run: Run, rate: float | None) -> Run:
    """The rudder in the log as measured: its order, or an angle that follows it at a rate [rad/s]."""
    order = run.commands["delta_r_cmd"]
    angle = order.copy()
    if rate is not None:
        for k, step in enumerate(np.diff(run.t)):
            angle[k + 1] = angle[k] + np.clip(order[k] - angle[k], -rate * step, rate * step)
    rest = {k: v for k, v in run.commands.items() if k != "delta_r_cmd"}
    return replace(run, commands=rest, measured_inputs={"delta_r": angle})


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("stride", "logged", "stated", "named"),
    [
        (1, None, math.inf, True),  # 230 degrees a second: no fin
        (10, None, math.radians(3.0), True),  # 23 degrees a second where the fin does 3
        (10, math.radians(10.0), math.radians(10.0), False),
        (10, None, math.inf, False),  # no rate stated: a fast fin does that
        (50, None, math.radians(6.0), False),  # 4.6 degrees a second, orders in step with the readings
    ],
)
def test_an_order_read_as_measured_is_told_by_the_rate_of_the_fin(stride, logged, stated, named):
    runs = [steered(every(weave(k, n=3000), stride), logged) for k in (1, 2)]
    found = check_input(runs, fin_rates={"delta_r": stated}).findings
    assert [f.name for f in found] == (["delta_r: order read as measured"] if named else [])


def test_a_turn_with_the_rudder_amidships_is_remarked_on_where_all_runs_have_it():
    def run(rate: float, opening: int = 150) -> Run:
        one = weave(3)
        rudder = one.commands["delta_r_cmd"].copy()
        rudder[:opening] = 0.0
        psi = one.data["psi"] + rate * one.t - np.where(np.arange(one.t.size) < opening, one.data["psi"], 0.0)
        return replace(one, data={**one.data, "psi": psi}, commands={"delta_r_cmd": rudder})

    said = check_runs([run(0.02), run(0.03)])
    assert "turns to starboard by 1.4 degrees a second in 2 of 2 runs" in " ".join(said)
    for runs in ([run(0.02)], [run(0.02), run(-0.02)], [run(0.02), run(0.0)], [run(0.02, 5), run(0.02, 5)]):
        assert not any("amidships" in text for text in check_runs(runs))


@pytest.mark.parametrize(
    ("vehicle", "seconds", "kept"), [("nps_auv2", 150, False), ("lauv", 100, False), ("remus100", 100, True)]
)
def test_a_current_begins_a_turn_that_only_a_vehicle_unstable_on_course_keeps_up(
    monkeypatch, vehicle, seconds, kept
):
    """What the remark on a turn with the rudder amidships says of a current, which a diagnosis may name: the
    run begins at rest beside the water, as one that was held or towed until then."""
    monkeypatch.setattr("bayesid.simulation.virtual_trial.carried_by_water", lambda model, par, x0: x0)
    order, across = f"straight:duration={seconds}", {"ocean_current.V_east": 0.4}
    rate = np.abs(simulate(vehicle, order, dt=0.1, change=across).runs[0].data["r"])
    assert (rate[-1] > 0.3 * rate.max()) == kept and (rate[-1] < 1e-3 * rate.max()) != kept
    assert np.abs(simulate(vehicle, order, dt=0.1).runs[0].data["r"]).max() < 1e-9  # control: still water
    runs = simulate(vehicle, "turn:12", "zigzag:10/10", dt=0.1, change=across).runs
    (said,) = (text for text in check_runs(runs) if "amidships" in text)
    assert "a current begins such a turn where a run begins, and only a vehicle that is unstable" in said


@pytest.mark.parametrize("current", [0.0, 0.1])
def test_speed_over_ground_labelled_as_through_the_water_is_remarked_on(current):
    """The track shows a current beside a speed through the water, none beside one over ground."""

    def labelled(run: Run) -> Run:
        data = {"u_water" if k == "u" else "v_water" if k == "v" else k: v for k, v in run.data.items()}
        return replace(run, data=data | {"x": data["x"] + current * run.t})

    runs = [labelled(weave(k)) for k in (1, 2)]
    assert ["no current" in text for text in check_runs(runs)] == ([] if current else [True])
    assert not check_runs([weave(1), weave(2)])


def test_what_the_study_plants_as_harmless_leaves_the_motion_and_says_what_it_states():
    rows = {row.name: row for row in harmless(math.radians(20.0))}
    clean = weave(1)
    trial = Trial("weave", Path(), "remus100", 3, (clean,), {"u": 0.01, "r": 0.003})
    assert logged(trial, rows["noise stated 1/10"], 0).noise == pytest.approx({"u": 0.001, "r": 0.0003})
    ground = logged(trial, rows["over ground as through the water, no current"], 0)
    assert ground.noise == {"u_water": 0.01, "r": 0.003} and "u" not in ground.runs[0].data
    wrapped = logged(trial, rows["heading wrapped"], 0).runs[0].data["psi"]
    turns = (wrapped - clean.data["psi"]) / (2 * math.pi)
    assert np.ptp(turns) < 1e-9 and turns[0] == pytest.approx(round(turns[0]))
    angle = logged(trial, rows["measured angle as order"], 0).runs[0].commands["delta_r_cmd"]
    assert np.abs(np.diff(angle)).max() == pytest.approx(math.radians(20.0) * 0.1)
    late = logged(trial, rows["rudder late by a sample"], 0).runs[0].commands["delta_r_cmd"]
    assert np.array_equal(late[1:], clean.commands["delta_r_cmd"][:-1])
    stamps = logged(trial, rows["stamps of writing"], 0).runs[0].t - clean.t
    assert stamps.min() >= 0.0 and stamps.max() < 0.1
    rounded = logged(trial, rows["stamps rounded down"], 0).runs[0].t
    assert np.allclose(np.diff(rounded), 0.1)


def test_the_sign_of_the_rudder_is_seen_where_every_other_heading_is_empty():
    """As where channels of other rates share the file; speeds astern and unknown ones included."""
    whole = weave()
    odd = np.arange(whole.n_samples) % 2 == 1
    thin = {name: np.where(odd, np.nan, values) for name, values in whole.data.items()}
    turned = {name: -values for name, values in whole.commands.items()}
    assert check_rudder(whole).t_value < -6.0 and check_rudder(replace(whole, data=thin)).t_value < -6.0
    assert check_rudder(replace(whole, data=thin, commands=turned)).t_value > 6.0
    unknown = np.full(whole.n_samples, np.nan)
    assert check_rudder(replace(whole, data=thin | {"u": unknown})).t_value < -6.0
    assert check_rudder(replace(whole, data=thin | {"u": -thin["u"]})) is None
    assert check_rudder(replace(whole, data=thin | {"psi": unknown})) is None


def test_velocities_in_earth_axes_are_turned_where_no_heading_was_read():
    run = weave()
    odd = np.arange(run.n_samples) % 2 == 1
    turned = (run.data["u"] + 1j * run.data["v"]) * np.exp(1j * run.data["psi"])
    wrapped = np.angle(np.exp(1j * run.data["psi"]))
    earth = {"u": np.where(odd, turned.real, np.nan), "v": np.where(odd, turned.imag, np.nan)}
    logged = replace(run, data=run.data | earth | {"psi": np.where(odd, np.nan, wrapped)})
    body = apply(Correction(velocity_axes="earth"), logged)
    for name in ("u", "v"):
        told = np.isfinite(body.data[name])
        assert told.sum() >= odd.sum() - 1 and not told[~odd].any()
        # a heading between two readings is off by half the noise of either
        assert np.max(np.abs(body.data[name] - run.data[name])[told]) < 5 * 0.006 * 1.5


def test_sway_at_rest_until_the_first_order_of_a_simulation_without_noise_is_not_frozen():
    # a straight run of 70 s before a turn: v was told to repeat its last value
    t = np.arange(0.0, 200.0, 0.5)
    r = np.where(t > 70.0, 0.02 * (1.0 - np.exp(-(t - 70.0) / 5.0)), 0.0)
    psi = np.concatenate(([0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * 0.5)))
    u, v = np.full(t.size, 5.0), -20.0 * r
    over_ground = (u + 1j * v) * np.exp(1j * psi)
    place = np.concatenate(([0j], np.cumsum(0.25 * (over_ground[1:] + over_ground[:-1]))))
    noise = np.random.default_rng(0).normal(0.0, 0.5, (2, t.size))
    data = {"x": place.real + noise[0], "y": place.imag + noise[1], "psi": psi, "r": r, "u": u, "v": v}
    orders = {"delta_r_cmd": np.where(t > 70.0, -0.3, 0.0), "n_cmd": np.full(t.size, 60.0)}
    run = Run("turn", "", "identify", t, data, orders)
    assert [f.name for f in check_input([run]).findings if "frozen" in f.name] == []
    stopped = np.where(
        (t > 100.0) & (t < 140.0), v[200], v + np.random.default_rng(1).normal(0, 0.02, t.size)
    )
    froze = replace(run, data={**data, "v": stopped})
    assert "frozen v" in [f.name for f in check_input([froze]).findings]
