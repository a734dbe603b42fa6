"""Practice flights: what was added is what acts, and RotorPy's flights are told in
our conventions."""

import json

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.paths import ROOT
from tests.support.sizes import rms
from tests.support.vehicles import VEHICLE
from windwrench.dynamics import EffectSetting
from windwrench.dynamics.effects import check_setting, get, names
from windwrench.evidence.residual_wrench import residual_wrench
from windwrench.evidence.trials.outsiders import HELD_BACK, OUTSIDERS
from windwrench.evidence.trials.practice_flights import SIZES, draw_effect, fly_practice
from windwrench.identification.motion.signals import log_signals
from windwrench.identification.motion.smoothing import low_pass

WEIGHT = VEHICLE.weight
ARM = VEHICLE.arm_l
LARGEST = 0.3  # parts of weight (times the arm, for torque) that a disturbance reaches in flight
CUTOFF = 4.0  # Hz
EDGE = 200  # samples
DISTURBANCES = sorted({**OUTSIDERS, **HELD_BACK})
# sizes of each; ``python -m tests.evidence.test_practice_flights`` writes them anew
GOLDEN = ROOT / "tests" / "golden" / "disturbances.json"


def left_over(log, vehicle):
    """Residual (n, 6) through the low-pass, and the true wrench in the world frame through the
    same.
    """
    (signals,) = log_signals(log)
    r = residual_wrench(signals, vehicle)
    r[:, 3:] = np.einsum("nij,nj->ni", signals.rotation, r[:, 3:])
    truth = np.column_stack([log.force, log.torque])
    return tuple(low_pass(x, CUTOFF, signals.period)[EDGE:-EDGE] for x in (r, truth))


def disturbed(name):
    """Residual and true wrench of a flight under a disturbance, as ``left_over`` returns them."""
    trajectory = {
        "vortex_ring": "vertical",
        "thrust_saturation": "vertical",
        "thermal_column": "gentle",
        "wall_attraction": "gentle",
    }.get(name, "excite")
    log = fly_practice(VEHICLE, (), trajectory, 8.0, 3, name, turbulence=0.0, sensor=0.0)
    return left_over(log, VEHICLE)


def spread(truth):
    """Root mean square of each component of a wrench."""
    return rms(truth, axis=0)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_a_disturbance_acts_in_flight_and_is_what_the_residual_shows(name):
    assert {**OUTSIDERS, **HELD_BACK}[name].__doc__
    r, truth = disturbed(name)
    kept = json.loads(GOLDEN.read_bytes())[name]
    assert_allclose(spread(truth), kept, rtol=1e-3, atol=1e-6)
    scale = np.repeat([WEIGHT, WEIGHT * ARM], 3)
    assert abs(truth / scale).max() < LARGEST
    axis = int(np.argmax(truth.std(axis=0) / scale))
    assert truth[:, axis].std() > 0.003 * scale[axis]
    assert np.corrcoef(r[:, axis], truth[:, axis])[0, 1] > 0.95


def test_the_same_seed_gives_the_same_log_and_another_one_another():
    drag = (EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4}),)
    logs = [
        fly_practice(VEHICLE, drag, "excite", 2.0, seed, "contact_pushes") for seed in (1, 1, 2)
    ]
    for field in ("position", "quaternion", "rotor_speeds", "voltage", "force", "torque"):
        assert_array_equal(getattr(logs[0], field), getattr(logs[1], field))
        assert not np.array_equal(getattr(logs[0], field), getattr(logs[2], field))


@pytest.mark.parametrize("size", SIZES)
def test_drawn_effects_are_in_range_and_grow_with_the_size(size):
    for name in names():
        setting = check_setting(draw_effect(name, VEHICLE, size, default_rng(1)))
        assert set(setting.coefficients) == {c.name for c in get(name).coefficients}
        typical = max(abs(c.typical[0]) for c in get(name).coefficients)
        if name not in ("fan_jet", "slung_payload", "wind", "clock_offset", "latency"):
            drawn = max(abs(value) for value in setting.coefficients.values())
            assert 0.8 * SIZES[size] <= drawn / typical * 1.0000001
            assert drawn / typical <= 1.2500001 * SIZES[size]


if __name__ == "__main__":
    sizes = {name: spread(disturbed(name)[1]).tolist() for name in DISTURBANCES}
    GOLDEN.write_text(json.dumps(sizes, indent=1) + "\n", encoding="utf-8")
