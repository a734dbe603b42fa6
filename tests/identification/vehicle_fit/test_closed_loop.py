"""The flight loop's reaction: in predictions, in a vehicle's file, and fitted."""

from dataclasses import astuple, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.support.flown import recorded
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import LoopReaction, ModelStatus
from windwrench.dynamics.vehicle_file import dump_vehicle, parse_vehicle
from windwrench.identification import predict
from windwrench.identification.prediction import logged_starts
from windwrench.identification.vehicle_fit.closed_loop import UNITS, fit_loop

CRAZYFLIE = load_vehicle("crazyflie")
STATUS = ModelStatus("identified", "refuted")
WHOLE = LoopReaction(1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
DAMPED = LoopReaction(0.0, 0.0, 0.0, 1e6, 5.0, 0.0, 0.0, 0.0, 3.0)
LOOP = LoopReaction(0.4, 0.6, 0.3, 25.0, 6.0, 15.0, 4.0, 1.5, 5.0)


@pytest.fixture(scope="module")
def log():
    return recorded("excite", 15.0, vehicle=CRAZYFLIE)


def with_loop(loop):
    return replace(CRAZYFLIE, status=STATUS, closed_loop=loop)


def test_a_loop_that_answers_nothing_is_the_vehicle(log):
    """Without constant moments: the flight has none, and little is left of their means at 10 s."""
    plain, whole = (predict(log, v, every=50) for v in (CRAZYFLIE, with_loop(WHOLE)))
    assert_allclose(whole.position[40:], plain.position[40:], atol=0.01)
    assert_allclose(whole.angular_velocity[40:], plain.angular_velocity[40:], atol=0.2)


def test_the_flight_so_far_tells_a_constant_moment(log):
    """A centre of mass 2 mm off turns a prediction by 17 rad/s in 0.5 s."""
    off = replace(CRAZYFLIE, com=np.array([0.002, 0.0, 0.0]))
    vehicles = CRAZYFLIE, off, replace(off, status=STATUS, closed_loop=WHOLE)
    truth, plain, told = (predict(log, v, every=50).angular_velocity[40:, -1] for v in vehicles)
    assert abs(told - truth).mean() < 0.2 * abs(plain - truth).mean()


def test_a_body_of_which_nothing_is_measured_is_damped(log):
    path = predict(log, with_loop(DAMPED), every=50)
    after = path.period * np.arange(1, path.velocity.shape[1] + 1)[:, None]
    decay = np.exp(-after * [5.0, 5.0, 3.0])
    first = path.angular_velocity[:, :1] / decay[0]
    assert_allclose(path.angular_velocity, first * decay, atol=0.01 * abs(first).max())


def test_tilt_and_velocity_turn_the_body_level(log):
    """About x and y at rest: the stiffness against a tilt, and two moments of a velocity. Half of
    the one that the loop answers is known as constant after a second.
    """
    loop = replace(DAMPED, unmeasured=0.0, stiffness=2.0, flapping=3.0, never_answered=1.0)
    state = np.zeros((len(log.t), 13))
    state[:, 3] = np.cos(0.05)
    state[:, 4] = np.sin(0.05)  # 0.1 rad about x
    state[:, 7] = 1.0
    path = predict(log, with_loop(loop), 0.02, 100, state)
    first = path.angular_velocity[:, 0] / path.period
    expected = [[-2.0 * np.sin(0.1), -1.0 - 3.0 / (1.0 + t), 0.0] for t in log.t[path.start]]
    assert_allclose(first, expected, rtol=0.05, atol=0.05)


def test_a_file_keeps_the_loop():
    again = parse_vehicle(dump_vehicle(with_loop(LOOP)))
    assert again.closed_loop == LOOP
    assert again.status.torque == "refuted"


@pytest.mark.parametrize(("loop", "fitted"), [(LOOP, 9), (DAMPED, 2)])
def test_a_known_loop_comes_back(log, loop, fitted):
    starts = logged_starts(log, CRAZYFLIE, [(log.t[0], log.t[-1])], 0.5)
    segment = np.arange(len(starts.rows)) // 8
    made = starts._replace(segment=segment, seen=starts.flown(with_loop(loop)))
    fit = fit_loop([made], with_loop(None), damped=fitted == 2)
    found = dict(zip(UNITS, astuple(fit.loop), strict=True))
    for name, value in zip(UNITS, astuple(loop), strict=True):
        assert found[name] == pytest.approx(value, rel=0.1, abs=0.05), name
    without = fit_loop([made.those(segment > 1)], with_loop(None), fit.loop, fitted == 2)
    assert astuple(without.loop) == pytest.approx(astuple(fit.loop), rel=0.1, abs=0.1)
    other = fit_loop([starts._replace(segment=segment)], with_loop(None), fit.loop, fitted == 2)
    assert (other.deviations > 0.0).sum() == fitted
