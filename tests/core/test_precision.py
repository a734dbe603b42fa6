"""The core's memory as Python lays it out, and its two precisions.

``tests/live/test_export_c.py`` compiles the headers as a vehicle does: in double they say what the
extension says to the bit, under sanitizers nothing is read elsewhere.
"""

import numpy as np

from tests.support.exported_c.hostile import PERIOD, hostile
from tests.support.vehicles import POSE, VEHICLE
from windwrench import _core
from windwrench.estimator import WrenchUKFBatch
from windwrench.estimator.filter_record import FILTER


def test_the_record_of_python_begins_with_the_memory_of_the_core():
    assert FILTER.fields["innovation"][1] == _core.FILTER_SIZE
    assert FILTER.itemsize == _core.CONSTANT_GAIN_SIZE


def test_single_precision_follows_double():
    flown = hostile(VEHICLE, 5)
    parts = (flown[name] for name in ("rotor_speeds", "position", "quaternion"))
    flight = [np.stack([part] * 3, axis=1) for part in parts]
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
    # before the first fault; each of the two then has a way of its own for a moment
    assert max(apart[:100]) < 0.02
    assert np.median(apart) < 0.02
