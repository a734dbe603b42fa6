"""One stated deviation wherever an estimate is told: filters, batches, logs, streams and C.

It holds for vehicles that are drawn from their stated uncertainty.
"""

from functools import partial

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.exported_c.compiled import CompiledFilter, begin, needs, take
from tests.support.model_flights import drawn
from tests.support.vehicles import VEHICLE
from windwrench.envs.recording import record_flight
from windwrench.estimator import WrenchUKFBatch
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
        record_flight(drawn(VEHICLE, default_rng(seed)), (), "circle", 5.0, seed)
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


def by_batch(flights):
    batch = WrenchUKFBatch(VEHICLE, COUNT, gate=0.9999)
    samples = [np.stack([flown[name] for flown in flights], axis=1) for name in SAMPLE]
    batch.reset(samples[1][0], samples[2][0])
    out = [told(batch.estimate)]
    out += [told(batch.step(*(part[k] for part in samples))) for k in range(1, STEPS)]
    return np.stack(out, axis=1)


def by_stream(flown, commanded=False):
    live = LiveFilter(VEHICLE, Tallies())
    rows = (
        Row(flown["t"][k], 0, commanded=commanded, **{name: flown[name][k] for name in SAMPLE})
        for k in range(STEPS)
    )
    outputs = [output for row in rows for output in live.take(row)]
    return np.array([[*np.roll(o.wrench, 3), *np.roll(o.std, 3)] for o in outputs])


def by_log(flown, smooth):
    columns = {name: flown[name][:STEPS] for name in ("t", *SAMPLE)}
    log = FlightLog(**columns, name="flight", source="flight")
    return told(estimate_log(log, VEHICLE, smooth=smooth))


def of_each(way):
    return lambda flights: [way(flown) for flown in flights]


def of_filter(kind, compiled, folder):
    exported = export_c(VEHICLE, kind)
    one = CompiledFilter(exported, folder) if compiled else exported.filter
    return of_each(partial(by_filter, one))


WAYS = {
    **{kind: partial(of_filter, kind, False) for kind in ESTIMATORS},
    **{f"{kind} in C": partial(of_filter, kind, True) for kind in ESTIMATORS},
    "batch": lambda folder: by_batch,
    "stream": lambda folder: of_each(by_stream),
    "log": lambda folder: of_each(partial(by_log, smooth=False)),
    "smoothed": lambda folder: of_each(partial(by_log, smooth=True)),
}


@pytest.mark.parametrize("way", WAYS)
def test_errors_of_drawn_vehicles_are_as_large_as_it_says(way, flights, tmp_path):
    """Turbulence is no random walk: of 80 vehicles the mean squares are 0.55 and 0.63, not 1."""
    if way.endswith("in C"):
        needs("gcc")
    found = np.array(WAYS[way](tmp_path)(flights))[:, LOOKED_AT]
    true = np.array([np.hstack([flown[name] for name in WRENCH])[LOOKED_AT] for flown in flights])
    z = (found[..., :6] - true) / found[..., 6:]
    torque = np.mean(z[..., :3] ** 2)
    force = np.mean(z[..., 3:] ** 2)
    print(f"{way}: mean square of z: torque {torque:.2f}, force {force:.2f}; {abs(z).max():.1f}")
    assert 0.4 < torque < 1.2
    assert 0.4 < force < 1.2
    assert np.abs(z).max() < 6.0


@pytest.mark.parametrize("commanded", [False, True])
def test_a_stream_says_what_a_log_says(flights, commanded):
    """Rotor speeds of commands are known less well."""
    columns = {name: flights[0][name][:STEPS] for name in ("t", *SAMPLE)}
    log = FlightLog(**columns, name="flight", source="flight", commanded=commanded)
    stream = by_stream(flights[0], commanded)
    assert_allclose(stream[1:], told(estimate_log(log, VEHICLE))[1:], rtol=1e-9)
    assert (stream[-1, 11] > 0.1 * VEHICLE.weight) == commanded
