"""Laws with a memory."""

import numpy as np
import pytest

from windwrench.controllers import Admittance, AdmittancePID, Lead, Ratio
from windwrench.controllers.observation import FORCE_X, MAX_COMMAND, OBSERVATION_SIZE, TORQUE_Z


def observation(torque=0.0, force=0.5):
    o = np.zeros(OBSERVATION_SIZE, dtype=np.float32)
    o[TORQUE_Z], o[FORCE_X] = torque, force
    return o


def test_lead_is_the_ratio_law_plus_the_rate_of_the_ratio():
    lead = Lead(gain=10.0, lead=2.0, least_force=0.2)
    ratio = Ratio(gain=10.0, least_force=0.2)
    first = observation(0.01)
    assert lead(first)[0] == pytest.approx(ratio(first)[0])  # no rate yet
    second = observation(0.012)
    rate = (0.012 - 0.01) / 0.5 / 0.08
    assert lead(second)[0] == pytest.approx(ratio(second)[0] - 2.0 * rate, rel=1e-4)
    lead.reset()
    assert lead(second)[0] == pytest.approx(ratio(second)[0])


def test_the_pid_law_without_its_terms_is_the_admittance_law():
    pid, plain = AdmittancePID(gain=18.0, integral=0.0, lead=0.0), Admittance(gain=18.0)
    for torque in (0.01, -0.02, 0.03):
        assert pid(observation(torque)) == plain(observation(torque))


def test_the_integral_follows_and_does_not_wind_up():
    pid = AdmittancePID(gain=1.0, integral=10.0, lead=0.0)
    for _ in range(10):
        command = pid(observation(0.02))[0]
    assert command == pytest.approx(-(0.02 + 10.0 * 10 * 0.08 * 0.02), rel=1e-4)
    for _ in range(1000):
        pid(observation(0.2))
    assert -MAX_COMMAND <= pid(observation(0.2))[0] <= -0.8
    # a torque of the other sign takes it off the bound at once, not after as long a time
    turned = [pid(observation(-0.2))[0] for _ in range(12)]
    assert turned[-1] > 0.0
    pid.reset()
    assert pid(observation(0.0))[0] == 0.0
