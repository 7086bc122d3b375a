"""Coefficients in every table: prime value, SI value, SI unit."""

from dataclasses import replace

import pytest

from bayesid.model.vehicles import coef_si, load_vehicle, prime_scale
from bayesid.report.coefficient_cells import cells, prime


def test_the_prime_value_of_a_prime_set_is_that_of_its_file():
    vehicle = load_vehicle("generic_sub")
    si = coef_si(vehicle)
    for name, value in vehicle.coef.items():
        assert prime(vehicle, name, si[name]) == pytest.approx(value, rel=1e-12), name


def test_a_dimensional_set_has_prime_values_by_density_and_length():
    vehicle = load_vehicle("remus100")
    assert prime_scale(vehicle, "N_r") == 1.0
    # N_r u r: 1/2 rho L^4, SNAME 1950
    shown, si, unit = cells(vehicle, "N_r", -9.4)
    assert shown == pytest.approx(-9.4 / (0.5 * vehicle.rho * vehicle.L**4)) and (si, unit) == (-9.4, "kg m")
    twice = replace(vehicle, L=2 * vehicle.L)
    assert prime(twice, "N_r", -9.4) == pytest.approx(shown / 16)


@pytest.mark.parametrize("name", ["X_prop_n|n|", "sigma:psi", "rudder_offset.offset"])
def test_what_has_no_prime_form_has_a_dash(name):
    vehicle = load_vehicle("remus100")
    assert prime(vehicle, name, 1.0) is None and cells(vehicle, name, 1.0)[1] == 1.0
