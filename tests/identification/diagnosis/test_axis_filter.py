"""The steady filter of one axis, the noise that makes its innovations likeliest, and what a
coefficient changes in the innovations of all axes.
"""

import numpy as np
import pytest

from tests.support.flown import VEHICLE, recorded
from windwrench.identification.diagnosis.axis_filter import (
    AxisFlight,
    likeliest_noise,
    steady_noise,
)
from windwrench.identification.diagnosis.likelihood import Likelihood
from windwrench.identification.diagnosis.regression import Flights

PERIOD = 0.005
TRUE = steady_noise(1e-3, 0.5, 0.3, 0.2, PERIOD)
GAIN = 0.7  # on the jumps of the disturbance
HELD = np.array([1e-5])  # of an innovation, over the gain's prior


@pytest.fixture(scope="module")
def flight():
    """Return 100 s of an axis that is driven by a known acceleration and by what TRUE says."""
    rng = np.random.default_rng(1)
    n = 20_000
    drive = np.sin(np.arange(n) * PERIOD)
    jump = rng.normal(0.0, 0.05, (n, 1))
    keep = np.exp(-PERIOD / TRUE.time)
    x, v, d = 0.0, 0.0, TRUE.disturbance * rng.normal()
    pose = np.empty(n)
    for k in range(n):
        pose[k] = x + TRUE.pose * rng.normal()
        a = drive[k] + d + TRUE.white * rng.normal()
        x, v = x + PERIOD * v + 0.5 * PERIOD**2 * a, v + PERIOD * a
        d = keep * d + TRUE.disturbance * np.sqrt(1.0 - keep**2) * rng.normal()
        d += GAIN * jump[min(k + 1, n - 1), 0]
    return AxisFlight([pose], [drive], [0.0], PERIOD, [jump], np.array([2]), HELD)


@pytest.mark.parametrize("begun", [False, True])
def test_the_likeliest_noise_is_the_true_one(flight, begun):
    near = steady_noise(3e-3, 0.1, 1.0, 0.0, PERIOD)
    found, gains = likeliest_noise(flight, near, begun)
    assert found.pose == pytest.approx(TRUE.pose, rel=0.03)
    assert found.disturbance == pytest.approx(TRUE.disturbance, rel=0.2)
    assert found.time == pytest.approx(TRUE.time, rel=0.4)
    assert found.innovation == pytest.approx(TRUE.innovation, rel=0.02)
    assert gains == pytest.approx([GAIN], abs=0.15)


def test_the_search_follows_the_likelihood(flight):
    """Its derivatives are those of what the innovations leave, at gains that are the likeliest."""
    x = np.array([2.0 * np.log(300.0), np.log(0.5), 0.1])
    gains = flight.fit(x, np.array([GAIN])).gains
    for _ in range(3):
        gains = flight.fit(x, gains).gains
    here = flight.fit(x, gains)
    for i in range(3):
        step = 1e-4 * np.eye(3)[i]
        rise = flight.fit(x + step, gains).square - flight.fit(x - step, gains).square
        assert rise / 2e-4 == pytest.approx(-2.0 * here.products[i, -1], rel=0.01)


def test_a_jump_that_is_never_taken_has_no_gain(flight):
    none = [np.zeros((20_000, 1))]
    other = AxisFlight(flight.measured, flight.drive, [0.0], PERIOD, none, np.array([0]), HELD)
    found, gains = likeliest_noise(other, TRUE, True)
    assert gains == pytest.approx([0.0])
    assert found.disturbance > TRUE.disturbance  # what the jump would have told


def test_columns_say_what_a_coefficient_changes_in_the_innovations():
    """An attitude's innovation also moves the position's filter: without that 11 % are missing."""
    torque = {"tx": 0.003, "ty": -0.002, "tz": 0.0}
    flights = Flights([recorded(seconds=12.0)], VEHICLE)
    declared = Likelihood(flights, {})
    amended = Likelihood(flights, {"constant_torque": torque}, declared, same_noise=True)
    bases = [x.base(["constant_torque"], {}) for x in (declared, amended)]
    z = np.zeros(len(bases[0].total))
    z[-1] = 1.0
    for name, value in torque.items():
        at = bases[0].columns["constant_torque", name]
        z[at] = -value / bases[0].size[at]
    linear, exact = (z @ base.total @ z - bases[0].total[-1, -1] for base in bases)
    assert linear == pytest.approx(exact, rel=0.03)
