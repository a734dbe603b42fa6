"""The same hostile sequences through the Python filter and the exported C: one recovery, two
languages.
"""

import pytest

from tests.support.exported_c.compiled import PARTS, CompiledFilter, compare, needs_gcc
from tests.support.exported_c.hostile import PERIOD, hostile
from windwrench.dynamics import load_vehicle
from windwrench.live.export_c import export_c

pytestmark = needs_gcc
SEEDS, MANY = (0, 1, 104), range(2, 86)  # 104: on 17 m away; 1,044 sequences in all
# of a standard deviation, by which estimates may differ: rounding
LARGEST = {"single": 0.05, "double": 1e-6}


COMBINATIONS = [
    ("constant-gain", None, False, "double"),
    ("constant-gain", 0.9999, False, "single"),
    ("ekf", None, False, "single"),
    ("ekf", 0.9999, True, "double"),
    ("ukf", None, True, "single"),
    ("ukf", 0.9999, False, "double"),
]
OTHERS = [(*given, *(LARGEST.keys() - {precision})) for *given, precision in COMBINATIONS]


@pytest.mark.parametrize(
    ("estimator", "gate", "imu", "precision", "seeds"),
    [
        *((*given, SEEDS) for given in COMBINATIONS),
        *(pytest.param(*given, MANY, marks=pytest.mark.slow) for given in (*COMBINATIONS, *OTHERS)),
    ],
)
def test_c_and_python_agree_along_hostile_sequences(
    estimator, gate, imu, precision, seeds, tmp_path
):
    """Statuses and counts of restarts at every step, estimates within rounding."""
    vehicle = load_vehicle("ardrone2")
    exported = export_c(vehicle, estimator, rate=1.0 / PERIOD, gate=gate, precision=precision)
    c, restarts = CompiledFilter(exported, tmp_path), 0.0
    for seed in seeds:
        flown = hostile(vehicle, seed)
        if not imu:
            del flown["gyro"], flown["accelerometer"]
        worst = compare(c, exported.filter, flown)
        assert worst["status"] == 0.0, seed
        assert max(worst[part] for part in PARTS) < LARGEST[precision], (seed, worst)
        restarts += worst["restarts"]
    assert restarts > 0
