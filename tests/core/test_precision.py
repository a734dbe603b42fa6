"""The core's memory as Python lays it out, and its two precisions.

``tests/live/test_export_c.py`` compiles the headers as a vehicle does: in double they say what the
extension says to the bit, under sanitizers nothing is read elsewhere.
"""

import numpy as np
from numpy.random import default_rng

from tests.support.flights import PERIOD, yawing_flight
from tests.support.vehicles import POSE, VEHICLE
from windwrench import _core
from windwrench.estimator import WrenchUKFBatch
from windwrench.estimator.filter_record import FILTER

STEPS = 400


def flight_with_faults(seed):
    """Return rotor speeds, positions and quaternions (STEPS, .) with parts that were not measured,
    outliers, a gap, a jump for good and impossible rotor speeds.
    """
    flight = yawing_flight(VEHICLE, STEPS, seed=seed)
    rotors, position, quaternion = (
        flight[name][1:].copy() for name in ("rotors", "position", "quaternion")
    )
    rng = default_rng(seed)
    count = len(rotors)
    for what, chance in ((rotors, 0.02), (position, 0.05), (quaternion, 0.05)):
        what[rng.random(count) < chance] = np.nan
    position[rng.random(count) < 0.03] += 0.4
    quaternion[rng.random(count) < 0.01] = (0.0, 1.0, 0.0, 0.0)
    position[120:260] = quaternion[120:260] = np.nan
    position[310:] += (1.0, 0.0, 0.0)
    rotors[330] = 1e200
    return rotors, position, quaternion


def test_the_record_of_python_begins_with_the_memory_of_the_core():
    assert FILTER.fields["innovation"][1] == _core.FILTER_SIZE
    assert FILTER.itemsize == _core.CONSTANT_GAIN_SIZE


def test_single_precision_follows_double():
    flight = [np.stack([part] * 3, axis=1) for part in flight_with_faults(5)]
    batches = [
        WrenchUKFBatch(VEHICLE, 3, period=PERIOD, gate=0.999, precision=precision)
        for precision in ("double", "single")
    ]
    for batch in batches:
        batch.reset(*POSE)
    apart = []
    for sample in zip(*flight, strict=True):
        double, single = (batch.step(*sample) for batch in batches)
        apart.append(abs(double.force - single.force).max() / double.std_force.min())
    # before the first restart; each of the two then has a way of its own for a moment
    assert max(apart[:110]) < 0.02
    assert np.median(apart) < 0.02
