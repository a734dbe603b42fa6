"""Laws with a memory, and the flight loop's answer."""

import numpy as np
import pytest

from windwrench.controllers import Admittance, AdmittancePID, Lead, Ratio
from windwrench.controllers.flight_response import half_response
from windwrench.controllers.observation import FORCE_X, MAX_COMMAND, OBSERVATION_SIZE, TORQUE_Z
from windwrench.dynamics import load_vehicle
from windwrench.envs.closed_loop import ClosedLoop
from windwrench.envs.plant import NOISE, PlantSettings


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


def test_half_of_a_step_is_flown_when_the_linear_loop_says_so():
    vehicle = load_vehicle("ardrone2")
    settings = PlantSettings(disturbance_force=0.0, disturbance_torque=0.0, sensor_noise=False)
    loop = ClosedLoop(vehicle, settings=settings)
    rng = np.random.default_rng(0)
    loop.reset(rng, np.array([0.0, 0.0, 1.2]))
    loop.run(rng.standard_normal((200, NOISE)))
    loop.setpoint[4] = 0.3
    ticks = 0
    while loop.velocity[1] < 0.15 and ticks < 400:
        loop.run(rng.standard_normal((1, NOISE)))
        ticks += 1
    assert 0.005 * ticks == pytest.approx(half_response(), abs=0.03)
