"""What vehicles and motion capture do to an estimator: it stays finite, says what happened, is
right again soon, and honest all along.
"""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from windwrench.dynamics import InputError, load_vehicle
from windwrench.estimator import (
    ConstantGainFilter,
    NonlinearObserver,
    Recovery,
    UKFTuning,
    WrenchEKF,
    WrenchMassUKF,
    WrenchUKF,
    WrenchUKFBatch,
)

VEHICLES = {name: load_vehicle(name) for name in ("ardrone2", "crazyflie")}
FILTERS = {
    "ukf": WrenchUKF,
    "ekf": WrenchEKF,
    "mass": WrenchMassUKF,
    "constant gain": ConstantGainFilter,
    "observer": NonlinearObserver,
}
HEIGHT = 1.2  # m
FORCE = 0.1  # of the weight, upwards: what the rotors need not carry
RISE = 1.0  # s, of the default tuning


def hover(vehicle):
    """Rotor speeds (4,) of a hover under an upward force of ``FORCE`` weights."""
    return np.full(4, vehicle.hover_rate * np.sqrt(1.0 - FORCE))


# one fault: what happens, for how many samples, how large, and a seed
FAULTS = st.tuples(
    st.sampled_from(
        [
            "gap",
            "long gap",
            "jump",
            "jump for good",
            "back and forth",
            "inverted",
            "random attitudes",
            "random poses",
            "position only",
            "attitude only",
            "rotors",
            "rotors off",
            "frozen",
        ]
    ),
    st.integers(1, 120),
    st.floats(-3.0, 3.0).map(lambda power: 10.0**power),  # m: 1 mm to 1 km
    st.integers(0, 2**32 - 1),
)


class Flight:
    """A hover that is seen with faults, and an estimator that is fed from it."""

    def __init__(self, kind, vehicle, dt, gate):
        self.vehicle, self.dt = vehicle, dt
        self.estimator = FILTERS[kind](vehicle, period=dt, gate=gate)
        self.speeds = hover(vehicle)
        self.position = np.array([0.0, 0.0, HEIGHT])
        self.quaternion = np.array([1.0, 0.0, 0.0, 0.0])
        self.fixed_period = kind == "observer"

    def feed(self, speeds, position, quaternion, dt=None):
        if dt is None or self.fixed_period:
            estimate = self.estimator.step(speeds, position, quaternion)
        else:
            self.estimator.predict(speeds, dt)
            estimate = self.estimator.correct(position, quaternion)
        self.check(estimate)
        return estimate

    def check(self, estimate):
        assert np.isfinite(estimate.state[:19]).all()
        P = estimate.covariance
        scale = 1.0 / np.sqrt(np.diag(P))
        assert np.isfinite(P).all()
        # of the correlations: variances of 1e-9 and 1e4 stand side by side
        assert np.linalg.eigvalsh(P * scale[:, None] * scale)[0] > 0.0

    def suffer(self, kind, samples, size, seed):
        rng = np.random.default_rng(seed)
        speeds, position, quaternion = self.speeds, self.position, self.quaternion
        step = None if self.fixed_period else float(rng.choice([self.dt, 1e-3, 0.01, 0.1]))
        away = rng.standard_normal(3)
        away *= size / np.linalg.norm(away)
        if kind == "long gap":
            for _ in range(6000):
                estimate = self.estimator.step(speeds)
            self.check(estimate)
        elif kind == "jump for good":
            self.position = position + away
        for k in range(samples):
            p, q, w = position, quaternion, speeds
            if kind == "gap":
                p = q = None
            elif kind == "jump" and k == 0:
                p = position + away
            elif kind == "jump for good":
                p = self.position
            elif kind == "back and forth":
                p = position + (k % 2) * away
            elif kind == "inverted":
                q = np.array([0.0, 1.0, 0.0, 0.0])
            elif kind in ("random attitudes", "random poses"):
                q = rng.standard_normal(4)
                q /= np.linalg.norm(q)
                if kind == "random poses":
                    p = position + size * rng.standard_normal(3)
            elif kind == "position only":
                q = None
            elif kind == "attitude only":
                p = None
            elif kind == "rotors":
                w = rng.uniform(0.0, self.vehicle.omega_max, 4)
            elif kind == "rotors off":
                w = np.zeros(4)
            elif kind == "frozen":
                w = speeds * 1.05
            self.feed(w, p, q, step)

    def recover(self, seconds):
        for _ in range(int(np.ceil(seconds / self.dt))):
            estimate = self.feed(self.speeds, self.position, self.quaternion)
        return estimate


def live_through(kind, vehicle, dt, gate, faults, turn):
    flight = Flight(kind, VEHICLES[vehicle], dt, gate)
    # a start that is off by a turn of up to half a circle
    flight.estimator.reset(flight.position, [np.cos(turn / 2), np.sin(turn / 2), 0.0, 0.0])
    flight.recover(RISE)
    for fault in faults:
        flight.suffer(*fault)
    # good poses count from when the gate has had its time to believe them
    estimate = flight.recover(2.0 * RISE + (0.0 if gate is None else 0.7))
    wrench = np.concatenate([estimate.torque, estimate.force])
    truth = np.array([0.0, 0.0, 0.0, 0.0, 0.0, FORCE * VEHICLES[vehicle].weight])
    deviation = np.sqrt(np.diag(estimate.covariance)[12:18])
    assert estimate.status == "tracking"
    np.testing.assert_array_less(np.abs(wrench - truth), 3.0 * deviation)


SEQUENCES = given(
    vehicle=st.sampled_from(sorted(VEHICLES)),
    dt=st.sampled_from([0.001, 0.005, 0.01, 0.02, 0.05, 0.1]),
    gate=st.sampled_from([None, 0.99, 0.999, 0.999999]),
    faults=st.lists(FAULTS, min_size=1, max_size=4),
    turn=st.sampled_from([0.0, 0.0, 0.5, np.pi / 2, 3.0, np.pi]),
)
LENIENT = {"deadline": None, "suppress_health_check": list(HealthCheck), "derandomize": True}


@pytest.mark.parametrize("kind", FILTERS)
@settings(max_examples=25, **LENIENT)
@SEQUENCES
def test_an_estimator_survives_and_is_right_again(kind, vehicle, dt, gate, faults, turn):
    live_through(kind, vehicle, dt, gate, faults, turn)


@pytest.mark.slow
@pytest.mark.parametrize("kind", FILTERS)
@settings(max_examples=500, **LENIENT)
@SEQUENCES
def test_thousands_of_sequences(kind, vehicle, dt, gate, faults, turn):
    live_through(kind, vehicle, dt, gate, faults, turn)
