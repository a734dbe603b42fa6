"""Named effects that together are the exact equivalent of another one."""

from types import SimpleNamespace

import pytest

from tests.support.searches import VEHICLE, searched, settings
from windwrench.identification.inference.equivalence import (
    composite_doubts,
)
from windwrench.identification.inference.search import FittedEffects
from windwrench.studies.trials.practice_flights import fly_practice

FLIGHTS = SimpleNamespace(vehicle=VEHICLE)
MASS = VEHICLE.mass


@pytest.mark.parametrize(
    ("thrust", "cancels"), [(0.1, True), (0.104, True), (0.06, False), (-0.1, False)]
)
def test_mass_and_thrust_that_cancel_may_be_an_inertia(thrust, cancels):
    fit = FittedEffects({"mass": {"dm": 0.1 * MASS}, "thrust_scale": {"s": thrust}})
    assert bool(composite_doubts(FLIGHTS, fit)) == cancels


def test_what_coincides_within_its_noise_may_be_one_effect():
    fit = FittedEffects(
        {"thrust_scale": {"s": -0.033}, "inertia": {"jx": -0.071, "jy": -0.068, "jz": -0.034}}
    )
    assert not composite_doubts(FLIGHTS, fit)
    fit.std = {
        ("thrust_scale", "s"): 3e-5,
        ("inertia", "jx"): 0.021,
        ("inertia", "jy"): 0.020,
        ("inertia", "jz"): 0.003,
    }
    assert len(composite_doubts(FLIGHTS, fit)) == 1
    fit.std["inertia", "jx"] = 0.004
    assert not composite_doubts(FLIGHTS, fit)


@pytest.mark.parametrize("trajectory", ["hover", "vertical"])
def test_a_thrust_beside_a_steady_force_needs_flight_that_tells_them_apart(trajectory):
    """In hover they are the same but for a hundred-thousandth; the attitude's noise would have less
    thrust, and more force.
    """
    steady = {"constant_force": {"fx": -0.23, "fy": -0.23, "fz": -0.23}}
    quiet = {"seconds": 40.0, "seed": 1, "turbulence": 0.0, "sensor": 0.5}
    log = fly_practice(VEHICLE, settings(steady), trajectory, **quiet)
    search, _ = searched(log, ("constant_force", "thrust_scale", "mass"))
    fit = FittedEffects(steady)
    regression = search.linearise(fit)
    search.set_noise(fit, regression)
    asked = [gain.effect for gain in search.gains(fit, regression, search.gram(fit, regression))]
    assert ("thrust_scale" in asked) == (trajectory == "vertical")
