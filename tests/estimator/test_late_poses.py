"""Measurements that come late and out of order, against a filter that was given all in order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.testing import assert_array_equal

from tests.support.flights import PERIOD, yawing_flight
from tests.support.outcomes import refused
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.estimator import ConstantGainFilter, TimedFilter, WrenchUKF

LAG = EffectSetting("motor_lag", {"tau": 0.04})
DELAY = EffectSetting("latency", {"d": 0.02})
DRAG = EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4})
MARKER = EffectSetting("marker_offset", {"px": 0.02, "py": 0.0, "pz": -0.01})
PLAIN = load_vehicle("ardrone2")
VEHICLES = {
    "plain": PLAIN,
    "effects that remember": PLAIN.with_effects(LAG, DELAY),
    "drag, seen at a marker": load_vehicle("hummingbird").with_effects(MARKER, DRAG, LAG),
}
FILTERS = (WrenchUKF, ConstantGainFilter)


def fly(vehicle, steps, seed):
    """A yawing flight under a wrench of a tenth of the vehicle's weight."""
    force = 0.1 * vehicle.weight * np.array([0.6, -0.6, 0.5])
    torque = 0.02 * vehicle.weight * vehicle.arm_l * np.array([0.5, 0.5, 0.7])
    return yawing_flight(vehicle, steps, seed=seed, force=force, torque=torque)


FLIGHTS = {name: fly(vehicle, 120, seed=4) for name, vehicle in VEHICLES.items()}


def time(k):
    """Of the k-th set of rotor speeds, as the filter's clock has it."""
    return round(PERIOD * k, 9)


def make(kind, vehicle, gate=None):
    gated = {} if kind is ConstantGainFilter else {"gate": gate}
    return kind(vehicle, period=PERIOD, **gated)


def start(filter_, flight):
    filter_.reset(0.0, flight["position"][0], flight["quaternion"][0])


def batch(ukf, flight, measurements):
    """The estimate at the end of a flight of all ``measurements`` in order of their stamps:
    predictions end at each stamp and at each set of rotor speeds.
    """
    ukf.reset(flight["position"][0], flight["quaternion"][0])
    now = 0.0
    waiting = sorted(measurements, key=lambda m: m[0])
    for k in range(1, len(flight["rotors"])):
        reached = [m for m in waiting if m[0] <= time(k)]
        waiting = waiting[len(reached) :]
        for t, method, values in (*reached, (time(k), None, ())):
            if t > now:
                ukf.predict(flight["rotors"][k], t - now)
                now = t
            if method is not None:
                getattr(ukf, method)(*values)
    return ukf


def stream(timed, flight, measurements, delays):
    """The same as they come: each measurement its delay after its stamp, in arrays that the caller
    writes over.
    """
    start(timed, flight)

    def give(method, t, *values):
        given = [None if value is None else np.array(value) for value in values]
        getattr(timed, method)(t, *given)
        for array in given:
            if array is not None:
                array[:] = np.nan

    arrivals = sorted(
        (m[0] + delay, i, m) for i, (m, delay) in enumerate(zip(measurements, delays, strict=True))
    )
    for k in range(1, len(flight["rotors"])):
        give("predict", time(k), flight["rotors"][k])
        while arrivals and arrivals[0][0] <= time(k):
            _, _, (t, method, values) = arrivals.pop(0)
            give(method, t, *values)
    for _, _, (t, method, values) in arrivals:
        give(method, t, *values)
    return timed


def assert_same(timed, ukf):
    """Bit for bit: state and covariance, and all else that the filter remembers."""
    for one, other in zip(timed.ukf.memory, ukf.memory, strict=True):
        assert_array_equal(one, other)


def measured(flight, stamps, parts):
    """What is measured of a flight at ``stamps``: 1 position, 2 attitude, 3 both, 4 both and off, 5
    an IMU's.
    """
    out = []
    rng = default_rng(2)
    for t, part in zip(stamps, parts, strict=True):
        if part == 5:
            out.append((t, "correct_imu", (0.1 * rng.standard_normal(3), [0.0, 0.0, 9.81])))
            continue
        k = round(t / PERIOD)
        x = flight["position"][k]
        q = flight["quaternion"][k]
        x = x + 0.05 if part == 4 else x
        out.append((t, "correct", (x if part != 2 else None, q if part != 1 else None)))
    return out


STAMPS = st.lists(
    st.tuples(
        st.integers(0, 590_000).map(lambda us: round(1e-6 * us, 9)),
        st.sampled_from((1, 2, 3, 3, 3, 4, 5, 5, 5)),
        st.floats(0.0, 0.3),
    ),
    min_size=1,
    max_size=40,
    unique_by=lambda one: one[0],
)


@pytest.mark.parametrize("name", list(VEHICLES))
@settings(max_examples=25, deadline=None, derandomize=True)
@given(drawn=STAMPS, kind=st.sampled_from(FILTERS), gate=st.sampled_from((None, 0.999)))
def test_whatever_is_late_comes_out_as_if_it_had_not_been(name, drawn, kind, gate):
    vehicle = VEHICLES[name]
    flight = FLIGHTS[name]
    if kind is ConstantGainFilter:
        drawn = [one for one in drawn if one[1] != 5]
    measurements = measured(flight, [t for t, _, _ in drawn], [part for _, part, _ in drawn])
    timed = TimedFilter(make(kind, vehicle, gate), horizon=0.6)
    stream(timed, flight, measurements, [delay for _, _, delay in drawn])
    assert timed.too_late == 0
    assert_same(timed, batch(make(kind, vehicle, gate), flight, measurements))


def test_what_is_older_than_the_horizon_is_refused_and_changes_nothing():
    flight = FLIGHTS["plain"]
    timed = TimedFilter(make(WrenchUKF, PLAIN), horizon=0.1)
    start(timed, flight)
    pose = flight["position"][1], flight["quaternion"][1]
    assert timed.correct(-0.01, *pose) is None  # before the first pose
    for k in range(1, 101):
        timed.predict(time(k), flight["rotors"][k])
    before = timed.ukf.memory[0].copy()
    assert timed.correct(0.399, *pose) is None
    assert (timed.late, timed.too_late) == (0, 2)
    assert_array_equal(timed.ukf.memory[0], before)
    assert timed.correct(0.401, *pose) is not None
    assert (timed.late, timed.too_late) == (1, 2)
    start(timed, flight)
    assert (timed.late, timed.too_late, timed.fused, timed.time) == (0, 0, None, 0.0)


def test_what_is_wrong_is_named_and_changes_nothing():
    flight = FLIGHTS["plain"]
    timed = TimedFilter(make(WrenchUKF, PLAIN))
    pose = flight["position"][1], flight["quaternion"][1]
    start(timed, flight)
    for k in range(1, 41):
        timed.predict(time(k), flight["rotors"][k])
        timed.correct(time(k) - 0.001, *pose)
    before = timed.estimate.state.copy()
    events = len(timed._events)
    for words, call in (
        (r"0\.250000 s.*future.*0\.200000 s", lambda: timed.correct(0.25, *pose)),
        (r"0\.150000 s.*0\.200000 s", lambda: timed.predict(0.15, flight["rotors"][1])),
        ("finite time", lambda: timed.correct(np.nan, *pose)),
        ("length 1", lambda: timed.correct(0.15, pose[0], [2.0, 0.0, 0.0, 0.0])),
        (r"position \(3,\)", lambda: timed.correct(0.15, [1.0, 2.0], pose[1])),
        (r"rotor_speeds \(4,\)", lambda: timed.predict(0.3, [1.0, 2.0])),
        ("gyro", lambda: timed.correct_imu(0.15, [1.0, 2.0])),
    ):
        with refused(words):
            call()
        assert len(timed._events) == events
        assert_array_equal(timed.estimate.state, before)


def test_a_wrong_measurement_at_any_time_leaves_the_past_as_it_was():
    """Some stamps are just behind a snapshot of the filter, which must stay."""
    flight = FLIGHTS["plain"]
    measurements = measured(flight, [time(k) for k in (5, 20, 60)], [3, 3, 3])
    timed = stream(TimedFilter(make(WrenchUKF, PLAIN), 0.6), flight, measurements, [0.0] * 3)
    for k in range(1, 119):
        with refused("length 1"):
            timed.correct(time(k) - 0.001, flight["position"][0], [2.0, 0.0, 0.0, 0.0])
        if k % 17 == 0:
            measurements += measured(flight, [time(k)], [3])
            timed.correct(time(k), *measurements[-1][2])
    assert_same(timed, batch(make(WrenchUKF, PLAIN), flight, measurements))


@pytest.mark.parametrize("late", [0.0, 0.0025])
def test_what_is_kept_does_not_grow(late):
    timed = TimedFilter(make(WrenchUKF, PLAIN))
    flight = FLIGHTS["plain"]
    start(timed, flight)
    sizes = []
    for k in range(1, 1001):
        timed.predict(time(k), flight["rotors"][1])
        timed.correct(time(k) - late, flight["position"][0], flight["quaternion"][0])
        sizes.append((len(timed._events), sum(e.before is not None for e in timed._events)))
    assert max(sizes) == max(sizes[:200])
    assert max(events for events, _ in sizes) <= 2 * (60 + 5)
    assert max(snapshots for _, snapshots in sizes) <= 18
