"""Good poses after any spell of bad ones, in recorded flights: taken in within 2 s, by every kind
of filter; what is claimed of the wrench holds then. ``test_export_c_hostile.py`` holds C to it.
"""

import copy
from functools import cache

import numpy as np
import pytest

from tests.support.exported_c.flights import FLIGHTS, flight, vehicle_of
from windwrench.live.export_c import ESTIMATORS, export_c

SPELLS = (
    *("gap", "jump", "jump for good", "back and forth", "burst", "frozen", "tilted"),
    *("upside down", "random attitudes", "random poses"),
)
GATE = 0.9999
LONGEST, SOON, BEGUN = 3.0, 2.0, 4.0  # s: of a spell, until all is right, until the first one
KEPT = 50  # rows from one copy of a filter to the next
SEED = 1


def step(estimator, flown, k):
    estimator.predict(flown["rotor_speeds"][k], flown["dt"][k])
    if "gyro" in flown:
        estimator.correct_imu(flown["gyro"][k], flown["accelerometer"][k])
    estimator.correct(flown["position"][k], flown["quaternion"][k])


def seen(estimator):
    """Status, position, wrench, and the wrench's standard deviation: of noise alone."""
    e = estimator.estimate
    wrench = np.array([*e.torque, *e.force])
    return e.status, e.position, wrench, np.sqrt(np.diag(e.covariance)[12:18])


class Calm:
    """A filter along a flight without faults: what it says at each row, and copies of it."""

    def __init__(self, estimator, flown):
        self.flown, self.said, self.copies = flown, [None], {}
        estimator.reset(flown["position"][0], flown["quaternion"][0])
        for k in range(1, len(flown["dt"])):
            step(estimator, flown, k)
            self.said.append(seen(estimator))
            if k % KEPT == 0:
                self.copies[k] = copy.copy(estimator)


@cache
def calm(name, imu, kind):
    estimator = export_c(vehicle_of(name), kind, gate=GATE).filter
    rate = 200 // FLIGHTS[name][4]
    return Calm(estimator, flight(name, 15 * rate, SEED, faults=False, imu=imu)), rate


def turned(quaternions, angle, axis):
    w, v = np.cos(angle / 2), np.sin(angle / 2) * axis / np.linalg.norm(axis)
    q0, q = quaternions[:, :1], quaternions[:, 1:]
    return np.hstack([w * q0 - q @ v[:, None], w * q + q0 * v + np.cross(v, q)])


def spoil(x, q, when, rng):
    """Spoil positions (n, 3) and quaternions (n, 4); return the spell, and by how much the position
    is off for good (3,).
    """
    spell, away, count = str(rng.choice(SPELLS)), rng.standard_normal(3), when.stop - when.start
    size = 10.0 ** rng.uniform(-1.0, 1.5)
    away *= size / np.linalg.norm(away)
    if spell == "gap":
        x[when], q[when] = np.nan, np.nan
    elif spell in ("jump", "jump for good", "back and forth", "burst"):
        rows = {"jump": slice(when.start, when.start + 1), "burst": when}
        rows |= {"jump for good": slice(when.start, None)}
        x[rows.get(spell, slice(when.start, when.stop, 2))] += away
    elif spell == "frozen":
        x[when], q[when] = x[when.start], q[when.start]
    elif spell in ("tilted", "upside down"):
        angle = np.pi if spell == "upside down" else rng.uniform(0.0, np.pi)
        q[when] = turned(q[when], angle, rng.standard_normal(3))
    else:
        q[when] = rng.standard_normal((count, 4))
        q[when] /= np.linalg.norm(q[when], axis=1, keepdims=True)
        x[when] += (spell == "random poses") * size * rng.standard_normal((count, 3))
    return spell, away * (spell == "jump for good")


@pytest.mark.parametrize("count", [10, pytest.param(170, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ESTIMATORS)
def test_all_is_right_again_after_any_spell_of_bad_poses(kind, count):
    """Spells of 5 ms to 3 s, of jumps by 10 cm to 30 m and of turns by up to 180 degrees."""
    flights = [(name, imu) for name in FLIGHTS for imu in (False, kind != "constant-gain")]
    flights = flights if count > 10 else flights[2:4]
    wrong = []
    for i in range(count):
        rng = np.random.default_rng((SEED, i))
        name, imu = flights[int(rng.integers(len(flights)))]
        before, rate = calm(name, imu, kind)
        rows = len(before.said) - (LONGEST + SOON) * rate
        k = KEPT * int(rng.integers(np.ceil(BEGUN * rate / KEPT), rows // KEPT))
        when = slice(k + 1, k + 1 + int(rng.integers(1, LONGEST * rate)))
        flown = {part: values.copy() for part, values in before.flown.items()}
        spell, off = spoil(flown["position"], flown["quaternion"], when, rng)
        estimator, end = copy.copy(before.copies[k]), when.stop + round(SOON * rate)
        for row in range(k + 1, end):
            step(estimator, flown, row)
        status, position, wrench, std = seen(estimator)
        _, right, usual, _ = before.said[end - 1]
        misses = np.abs(wrench - usual) / std
        away = float(np.linalg.norm(position - right - off))
        if status != "tracking" or away > 0.1 or misses.max() > 4.0:
            wrong.append((i, name, imu, spell, when, status, away, misses.round(1)))
    assert not wrong
