"""Good poses after any spell of bad ones, in recorded flights: taken in within 2 s, by every kind
of filter; what is claimed of the wrench holds then. ``test_export_c.py`` holds C to it.
"""

import copy
from functools import cache

import numpy as np
import pytest
from numpy.linalg import norm
from numpy.random import default_rng

from tests.support.exported_c.compiled import begin, take
from tests.support.exported_c.flights import FLIGHTS, flight, vehicle_of
from tests.support.exported_c.hostile import befall
from windwrench.live.export_c import ESTIMATORS, export_c

SPELLS = (
    *("gap", "jump", "jump for good", "burst", "frozen", "tilted", "inverted"),
    *("random attitudes", "random poses"),
)
GATE = 0.9999
LONGEST = 3.0  # s, of a spell
SOON = 2.0  # s, until all is right
BEGUN = 4.0  # s, until the first one
KEPT = 50  # rows from one copy of a filter to the next
SEED = 1


def seen(estimator):
    """Status, position, wrench, and the wrench's standard deviation: of noise alone."""
    e = estimator.estimate
    wrench = np.array([*e.torque, *e.force])
    return e.status, e.position, wrench, np.sqrt(np.diag(e.covariance)[12:18])


@cache
def calm(name, imu, kind, noise):
    """A flight without faults and its rows a second, what a filter says at each row, and copies of
    the filter.
    """
    estimator = export_c(vehicle_of(name), kind, gate=GATE).filter
    rate = 200 // FLIGHTS[name][4]
    flown = flight(name, 15 * rate, SEED, imu=imu, noise=noise)
    begin(estimator, flown)
    said = [None]
    copies = {}
    for k in range(1, len(flown["dt"])):
        take(estimator, flown, k)
        said.append(seen(estimator))
        if k % KEPT == 0:
            copies[k] = copy.copy(estimator)
    return flown, rate, said, copies


@pytest.mark.parametrize(
    ("count", "noise"),
    [(10, 1.0), *(pytest.param(*many, marks=pytest.mark.slow) for many in ((170, 1.0), (80, 1.5)))],
)
@pytest.mark.parametrize("kind", ESTIMATORS)
def test_all_is_right_again_after_any_spell_of_bad_poses(kind, count, noise):
    """Spells of 5 ms to 3 s, of jumps by 10 cm to 30 m and of turns by up to 180 degrees."""
    flights = [(name, imu) for name in FLIGHTS for imu in (False, kind != "constant-gain")]
    flights = flights if count > 10 else flights[2:4]
    wrong = []
    for i in range(count):
        rng = default_rng((SEED, i))
        name, imu = flights[int(rng.integers(len(flights)))]
        sound, rate, said, copies = calm(name, imu, kind, noise)
        rows = len(said) - (LONGEST + SOON) * rate
        k = KEPT * int(rng.integers(np.ceil(BEGUN * rate / KEPT), rows // KEPT))
        when = slice(k + 1, k + 1 + int(rng.integers(1, LONGEST * rate)))
        flown = {part: values.copy() for part, values in sound.items()}
        spell = str(rng.choice(SPELLS))
        parts = (flown[name] for name in ("position", "quaternion", "rotor_speeds"))
        away = befall(spell, when, *parts, rng)
        flown["quaternion"] /= norm(flown["quaternion"], axis=1, keepdims=True)
        estimator = copy.copy(copies[k])
        end = when.stop + round(SOON * rate)
        for row in range(k + 1, end):
            take(estimator, flown, row)
        status, position, wrench, std = seen(estimator)
        _, right, usual, _ = said[end - 1]
        misses = abs(wrench - usual) / std
        off = float(norm(position - right - (spell == "jump for good") * away))
        if status != "tracking" or off > 0.1 or misses.max() > 4.0:
            wrong.append((i, name, imu, spell, when, status, off, misses.round(1)))
    assert not wrong
