"""The stated deviation of filters and of the smoother holds for vehicles that are drawn from their
stated uncertainty, and a stream says that of a log.

``test_ukf_batch.py`` holds a batch to the filter, ``test_export_c.py`` C, and
``test_wrench_series.py`` a log.
"""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.exported_c.compiled import begin, take
from tests.support.parameters import mostly_slow
from tests.support.vehicles import VEHICLE
from windwrench.envs.recording import record_flight
from windwrench.envs.scenarios import draw_vehicle
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.wrench_series import estimate_log
from windwrench.live.export_c import ESTIMATORS, export_c
from windwrench.live.filtering import LiveFilter
from windwrench.live.messages import Row
from windwrench.live.tallies import Tallies

COUNT = 20
STEPS = 1000
LOOKED_AT = slice(499, STEPS, 100)  # 2.5 to 5 s
SAMPLE = "rotor_speeds", "position", "quaternion"
WRENCH = ("torque", "force")
STATED = ("std_torque", "std_force")


@pytest.fixture(scope="module")
def flights():
    """Circles of drawn vehicles, measured with the declared noise."""
    return [
        record_flight(draw_vehicle(VEHICLE, default_rng(seed)), (), "circle", 5.0, seed)
        | {"dt": np.full(STEPS + 1, 0.005)}
        for seed in range(COUNT)
    ]


def told(estimate):
    """Torque, force and their deviations (..., 12)."""
    return np.hstack([getattr(estimate, name) for name in (*WRENCH, *STATED)])


def by_filter(one, flown):
    begin(one, flown)
    out = [np.full(12, np.nan)]
    for k in range(1, STEPS):
        take(one, flown, k)
        out.append(told(one.estimate))
    return out


def by_stream(flown, commanded):
    live = LiveFilter(VEHICLE, Tallies())
    rows = (
        Row(flown["t"][k], 0, commanded=commanded, **{name: flown[name][k] for name in SAMPLE})
        for k in range(STEPS)
    )
    outputs = [output for row in rows for output in live.take(row)]
    return np.array([[*np.roll(o.wrench, 3), *np.roll(o.std, 3)] for o in outputs])


def log_of(flown, **fields):
    columns = {name: flown[name][:STEPS] for name in ("t", *SAMPLE)}
    return FlightLog(**columns, name="flight", source="flight", **fields)


@pytest.mark.parametrize("way", mostly_slow([*ESTIMATORS, "smoothed"], lambda way: way != "ukf"))
def test_errors_of_drawn_vehicles_are_as_large_as_it_says(way, flights):
    """Turbulence is no random walk: of 80 vehicles torque's mean square is 0.49, not 1. It scatters
    by 0.11 over 20 of them.
    """
    if way == "smoothed":
        found = [told(estimate_log(log_of(flown), VEHICLE, smooth=True)) for flown in flights]
    else:
        one = export_c(VEHICLE, way).filter
        found = [by_filter(one, flown) for flown in flights]
    found = np.array(found)[:, LOOKED_AT]
    true = np.array([np.hstack([flown[name] for name in WRENCH])[LOOKED_AT] for flown in flights])
    z = (found[..., :6] - true) / found[..., 6:]
    torque = np.mean(z[..., :3] ** 2)
    force = np.mean(z[..., 3:] ** 2)
    print(f"{way}: mean square of z: torque {torque:.2f}, force {force:.2f}; {abs(z).max():.1f}")
    assert 0.27 < torque < 1.2
    assert 0.4 < force < 1.2
    assert np.abs(z).max() < 6.0


@pytest.mark.parametrize("commanded", [False, True])
def test_a_stream_says_what_a_log_says(flights, commanded):
    """Rotor speeds of commands are known less well."""
    log = log_of(flights[0], commanded=commanded)
    stream = by_stream(flights[0], commanded)
    assert_allclose(stream[1:], told(estimate_log(log, VEHICLE))[1:], rtol=1e-9, atol=1e-12)
    assert (stream[-1, 11] > 0.1 * VEHICLE.weight) == commanded
