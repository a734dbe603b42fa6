"""A stream states the deviations that a log states; ``test_consistency.py`` holds the filter's to
vehicles that are drawn from their stated uncertainty.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.support.vehicles import VEHICLE
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.wrench_series import estimate_log
from windwrench.live.filtering import LiveFilter
from windwrench.live.messages import Row
from windwrench.live.tallies import Tallies

STEPS = 1000
SAMPLE = "rotor_speeds", "position", "quaternion"
WRENCH = ("torque", "force")
STATED = ("std_torque", "std_force")


def told(estimate):
    """Torque, force and their deviations (..., 12)."""
    return np.hstack([getattr(estimate, name) for name in (*WRENCH, *STATED)])


def by_stream(flown, commanded):
    live = LiveFilter(VEHICLE, Tallies())
    rows = (
        Row(flown["t"][k], 0, commanded=commanded, **{name: flown[name][k] for name in SAMPLE})
        for k in range(STEPS)
    )
    outputs = [output for row in rows for output in live.take(row)]
    return np.array([[*np.roll(o.wrench, 3), *np.roll(o.std, 3)] for o in outputs])


@pytest.mark.parametrize("commanded", [False, True])
def test_a_stream_says_what_a_log_says(commanded):
    """Rotor speeds of commands are known less well."""
    flown = record_flight(VEHICLE, (), "circle", 5.0, 0)
    columns = {name: flown[name][:STEPS] for name in ("t", *SAMPLE)}
    log = FlightLog(**columns, name="flight", source="flight", commanded=commanded)
    stream = by_stream(flown, commanded)
    assert_allclose(stream[1:], told(estimate_log(log, VEHICLE))[1:], rtol=1e-9)
    assert (stream[-1, 11] > 0.1 * VEHICLE.weight) == commanded
