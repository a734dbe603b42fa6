"""What a regression allows for where rotor speeds are worked out from commands."""

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.identification.inference.commanded_rotors import (
    COMMANDED,
    DEVIATION_SIZES,
    THRUST_SCALE,
    cancels_thrust_scale,
    deviation,
    deviations,
    in_flight_by_thrust,
)
from windwrench.identification.logs.flight_log import FlightLog

VEHICLE = load_vehicle("ardrone2")


def still(seconds=10.0, rate=200.0, speeds=None):
    n = round(seconds * rate) + 1
    return FlightLog(
        np.arange(n) / rate,
        np.tile([0.0, 0.0, 1.0], (n, 1)),
        np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        np.full((n, 4), VEHICLE.hover_rate) if speeds is None else speeds,
    )


@pytest.mark.parametrize("count", [1, 2, 5])
def test_deviations_of_flights_sum_to_zero_and_are_apart(count):
    columns = deviations(count)
    assert len(columns) == len(DEVIATION_SIZES) * (count - 1)
    names = [name for _, name in columns if name.startswith(THRUST_SCALE)]
    table = np.array(
        [
            [deviation({"": {n: 1.0}}, THRUST_SCALE, log, count) for log in range(count)]
            for n in names
        ]
    ).reshape(len(names), count)
    np.testing.assert_allclose(table.sum(axis=1), 0.0, atol=1e-12)
    products = table @ table.T
    np.testing.assert_allclose(products, np.diag(np.diagonal(products)), atol=1e-12)


def test_only_the_time_in_the_air_counts():
    log = still(20.0)
    speeds = log.rotor_speeds.copy()
    speeds[(log.t < 4.0) | (log.t > 15.0)] *= 0.3
    found = in_flight_by_thrust(still(20.0, speeds=speeds), VEHICLE)
    # taking off and landing last beyond
    assert found.t[0] == pytest.approx(4.0 + COMMANDED.take_off, abs=0.5)
    assert found.t[-1] == pytest.approx(15.0 - COMMANDED.take_off, abs=0.5)
    whole = in_flight_by_thrust(log, VEHICLE)
    assert len(whole.t) == len(log.t)


def test_a_force_that_cancels_the_scale_of_thrust_is_none():
    up, weight = {"fx": 0.0, "fy": 0.0}, VEHICLE.weight
    less = {"thrust_scale": {"s": -0.1}}
    assert cancels_thrust_scale({**less, "constant_force": {**up, "fz": 0.08 * weight}}, weight)
    assert not cancels_thrust_scale({**less, "constant_force": {**up, "fz": 0.02 * weight}}, weight)
    assert not cancels_thrust_scale({**less, "constant_force": {**up, "fz": -0.1 * weight}}, weight)
