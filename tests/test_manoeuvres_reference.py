"""Library manoeuvres on built-in vehicles against an independent planar simulator."""

from __future__ import annotations

import math

import pytest

from bayesid import manoeuvres as man
from bayesid import measures
from bayesid.equations.model import build_model
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import run_manoeuvre, steady_start

DEG = math.pi / 180

# lengths in L, angles in deg, speeds and rates as ratios and deg/s, periods in L/U
REFERENCE = {
    "generic_sub": {
        "rpm": 60.0, "rudder": 20.0,
        "advance": 3.4765, "transfer": 2.0886, "tactical": 4.7884, "steady": 4.8523,
        "drift": 8.3769, "rate": 0.80241, "speed": 0.64344,
        "overshoots": (5.141, 7.274, 7.369), "period": 7.873, "loop": (), "residual": 0.0,
    },
    "remus100": {
        "rpm": 1500.0, "rudder": 13.6,
        "advance": 5.2890, "transfer": 4.2780, "tactical": 9.0662, "steady": 9.0877,
        "drift": 3.4417, "rate": 12.2229, "speed": 0.83520,
        "overshoots": (4.424, 4.983, 5.071), "period": 8.031, "loop": (-1.0, 0.0, 1.0), "residual": 0.10107,
    },
}  # fmt: skip


@pytest.fixture(scope="module", params=sorted(REFERENCE))
def boat(request):
    vehicle = load_vehicle(request.param)
    model = build_model(vehicle, 3)
    ref = REFERENCE[request.param]
    x0 = steady_start(model, ref["rpm"])
    scale = man.Scale(vehicle.L, float(x0[3]), ref["rpm"], vehicle.limits["delta_r"])
    return ref, scale, lambda text: run_manoeuvre(model, model.nominal, man.parse(text, scale), x0)


def test_turning_circle_of_the_library_matches_the_reference(boat):
    ref, scale, run = boat
    track, given = run(f"turn:{ref['rudder']},side=starboard")
    m = measures.turning_circle(
        track.t, track["x"], track["y"], track["psi"], given["delta_r_cmd"], track["u"], track["v"]
    )
    assert m.reasons == {} and m.side == "starboard"
    # transients depend on the step (a twentieth of a length in time would be 1 %); steady values do not
    found = (m.advance / scale.L, m.transfer / scale.L, m.tactical_diameter / scale.L)
    assert found == pytest.approx((ref["advance"], ref["transfer"], ref["tactical"]), rel=5e-3)
    found = (m.steady_diameter / scale.L, m.drift_angle / DEG, m.steady_yaw_rate / DEG, m.speed_ratio)
    assert found == pytest.approx((ref["steady"], ref["drift"], ref["rate"], ref["speed"]), rel=1e-3)


def test_zigzag_of_the_library_matches_the_reference(boat):
    ref, scale, run = boat
    track, given = run("zigzag:10/10,side=starboard")
    m = measures.zigzag(track.t, track["psi"], given["delta_r_cmd"])
    # the order comes at the first step after 10 deg: one step of yaw is up to 0.12 deg
    assert [angle / DEG for angle in m.overshoots[:3]] == pytest.approx(ref["overshoots"], abs=0.15)
    assert m.period / scale.LU == pytest.approx(ref["period"], rel=0.01)
    assert m.switch == pytest.approx(10 * DEG, abs=0.15 * DEG)


def test_spiral_and_pull_out_of_the_library_tell_a_stable_boat_from_an_unstable_one(boat):
    ref, scale, run = boat
    track, given = run(f"dieudonne:hold=40LU,dt={5 * scale.step}")
    m = measures.spiral(track.t, track["psi"], given["delta_r_cmd"], shortest=20 * scale.LU)
    assert [round(angle / DEG) for angle in m.differ] == pytest.approx(ref["loop"])
    assert m.unsettled == ()
    track, given = run(f"pullout:after=100LU,dt={5 * scale.step}")
    m = measures.pull_out(track.t, track["psi"], given["delta_r_cmd"])
    speed = math.hypot(track["u"][-1], track["v"][-1])
    assert m.residual_rate * scale.L / speed == pytest.approx(ref["residual"], abs=3e-4)
