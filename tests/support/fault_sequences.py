"""A hover that is seen with faults, and an estimator that is fed from it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics.vehicle import Vehicle
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.estimator import (
    ConstantGainFilter,
    WrenchEKF,
    WrenchEstimate,
    WrenchUKF,
)

Array = NDArray[np.float64]
Fault = tuple[str, int, float, int]  # kind, samples, size in m, seed

VEHICLES = {name: load_vehicle(name) for name in ("ardrone2", "crazyflie")}
FILTERS = {
    "ukf": WrenchUKF,
    "ekf": WrenchEKF,
    "constant gain": ConstantGainFilter,
}
HEIGHT = 1.2  # m
PERIOD = 0.005  # s, of the long flight
LONGEST = 60.0  # s, of a fault in it
FORCE = 0.1  # of the weight, upwards: what the rotors need not carry
RISE = 1.0  # s, of the default tuning


def hover(vehicle: Vehicle) -> Array:
    """Rotor speeds (4,) of a hover under an upward force of ``FORCE`` weights."""
    return np.full(4, vehicle.hover_rate * np.sqrt(1.0 - FORCE))


# what happens to a number of samples, of some size
KINDS = (
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
)
MOST_SAMPLES = 120
STEPS = (0.001, 0.005, 0.01, 0.02, 0.05, 0.1)  # s
GATES = (None, 0.99, 0.999, 0.999999)
TURNS = (0.0, 0.5, np.pi / 2, 3.0, np.pi)  # rad, by which a start is off


class Flight:
    """A hover that is seen with faults, and an estimator that is fed from it."""

    def __init__(self, kind: str, vehicle: Vehicle, dt: float, gate: float | None) -> None:
        self.vehicle, self.dt = vehicle, dt
        self.estimator: Any = FILTERS[kind](vehicle, period=dt, gate=gate)
        self.speeds = hover(vehicle)
        self.position = np.array([0.0, 0.0, HEIGHT])
        self.quaternion = np.array([1.0, 0.0, 0.0, 0.0])

    def feed(
        self,
        speeds: Array,
        position: Array | None,
        quaternion: Array | None,
        dt: float | None = None,
    ) -> WrenchEstimate:
        """Step the estimator and check what it says."""
        if dt is None:
            estimate: WrenchEstimate = self.estimator.step(speeds, position, quaternion)
        else:
            self.estimator.predict(speeds, dt)
            estimate = self.estimator.correct(position, quaternion)
        self.check(estimate)
        return estimate

    def check(self, estimate: WrenchEstimate) -> None:
        """Raise AssertionError where a number is not finite or the covariance is no covariance."""
        assert np.isfinite(estimate.state[:19]).all()
        P = estimate.covariance
        assert np.isfinite(P).all()
        # of the correlations: variances of 1e-9 and 1e4 stand side by side
        scale = 1.0 / np.sqrt(np.diag(P))
        try:
            np.linalg.cholesky(P * scale[:, None] * scale)
        except np.linalg.LinAlgError as error:
            raise AssertionError("the covariance is not positive definite") from error

    def suffer(self, kind: str, samples: int, size: float, seed: int) -> None:
        """Feed one fault."""
        rng = np.random.default_rng(seed)
        speeds, position, quaternion = self.speeds, self.position, self.quaternion
        step = float(rng.choice([self.dt, 1e-3, 0.01, 0.1]))
        away = rng.standard_normal(3)
        away *= size / np.linalg.norm(away)
        if kind == "long gap":
            for _ in range(6000):
                estimate = self.estimator.step(speeds)
            self.check(estimate)
        elif kind == "jump for good":
            self.position = position + away
        for k in range(samples):
            p: Array | None = position
            q: Array | None = quaternion
            w = speeds
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
                drawn = rng.standard_normal(4)
                q = drawn / np.linalg.norm(drawn)
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

    def recover(self, seconds: float) -> WrenchEstimate:
        """Feed good samples for some seconds; return the last estimate."""
        for _ in range(int(np.ceil(seconds / self.dt))):
            estimate = self.feed(self.speeds, self.position, self.quaternion)
        return estimate


def outcome(
    kind: str, vehicle: str, dt: float, gate: float | None, faults: list[Fault], turn: float
) -> tuple[str, float]:
    """Return the status and the largest error of the wrench in its own standard deviations, two
    rise times after the last fault (and, with a gate, the time that it needs to believe a pose).

    Raises:
        AssertionError: a number is not finite, or a covariance is not positive definite.
    """
    flight = Flight(kind, VEHICLES[vehicle], dt, gate)
    # a start that is off by a turn of up to half a circle
    flight.estimator.reset(flight.position, [np.cos(turn / 2), np.sin(turn / 2), 0.0, 0.0])
    flight.recover(RISE)
    for fault in faults:
        flight.suffer(*fault)
    estimate = flight.recover(2.0 * RISE + (0.0 if gate is None else 0.7))
    wrench = np.concatenate([estimate.torque, estimate.force])
    truth = np.array([0.0, 0.0, 0.0, 0.0, 0.0, FORCE * VEHICLES[vehicle].weight])
    deviation = np.sqrt(np.diag(estimate.covariance)[12:18])
    return estimate.status, float(np.max(np.abs(wrench - truth) / deviation))


def soak(kind: str, steps: int, seed: int) -> dict[str, Any]:
    """Fly ``steps`` steps of faults of up to a minute and good poses by turns, every step checked;
    return how often the wrench was right to three of its deviations after each fault.
    """
    rng = np.random.default_rng(seed)
    vehicle = VEHICLES["ardrone2"]
    flight = Flight(kind, vehicle, PERIOD, 0.999)
    flight.estimator.reset(flight.position, flight.quaternion)
    truth = np.array([0.0, 0.0, 0.0, 0.0, 0.0, FORCE * vehicle.weight])
    done = faults = right = 0
    while done < steps:
        samples = int(rng.uniform(0.0, LONGEST) / PERIOD) + 1
        name = str(rng.choice(KINDS))
        flight.suffer(name, samples, float(10.0 ** rng.uniform(-3, 3)), int(rng.integers(2**31)))
        estimate = flight.recover(2.0 * RISE + 0.7)
        done += samples + round((2.0 * RISE + 0.7) / PERIOD)
        faults += 1
        wrench = np.concatenate([estimate.torque, estimate.force])
        deviation = np.sqrt(np.diag(estimate.covariance)[12:18])
        right += bool(np.all(np.abs(wrench - truth) < 3.0 * deviation))
    return {
        "steps": done,
        "faults": faults,
        "right": right,
    }
