"""The core's headers as a vehicle compiles them, and the extension that Python calls."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.random import default_rng

from tests.support.flights import PERIOD, yawing_flight
from tests.support.vehicles import POSE, VEHICLE
from windwrench import _core
from windwrench.estimator import WrenchUKF, WrenchUKFBatch
from windwrench.estimator.filter_record import FILTER

STEPS = 400
COMPILER = shutil.which("g++") or shutil.which("clang++")
PLAIN = ["-std=c++17", "-ffp-contract=off", "-fno-exceptions", "-fno-rtti"]
STRICT = ["-Wall", "-Wextra", "-Werror", "-Wno-psabi"]


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


def begun(gate=0.999):
    ukf = WrenchUKF(VEHICLE, period=PERIOD, gate=gate)
    ukf.reset(*POSE)
    return ukf


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


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Return estimates (6, n, 20) of the driver, and the filter and samples it was given."""
    if COMPILER is None:
        pytest.skip("no C++ compiler: the headers alone are not compiled")
    folder = tmp_path_factory.mktemp("core")
    checks = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    source = Path(__file__).with_name("flight.cpp")
    words = [COMPILER, *PLAIN, *STRICT, "-O1", *checks, str(source), "-o", str(folder / "flight")]
    built = subprocess.run(words, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    rotors, position, quaternion = flight_with_faults(8)
    ukf = begun()
    felt = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, VEHICLE.gravity], (len(rotors), 1))
    felt[:, :6] += 0.01 * default_rng(8).standard_normal((len(rotors), 6))
    rows = np.column_stack([rotors, position, quaternion, felt])
    given = ukf.record.tobytes()[: _core.FILTER_SIZE] + rows.tobytes()
    ended = subprocess.run([folder / "flight"], input=given, capture_output=True, check=False)
    assert ended.returncode == 0, ended.stderr.decode()
    return np.frombuffer(ended.stdout).reshape(6, len(rows), 20), ukf, rows


def test_the_headers_alone_say_what_the_extension_says(flown):
    (double, *_), ukf, rows = flown
    for k, row in enumerate(rows):
        estimate = ukf.step(row[:4], row[4:7], row[7:11])
        assert np.array_equal(double[k, :19], estimate.state[:19])
        assert double[k, 19] == estimate.status_code


def test_lanes_are_the_single_filter_to_the_bit(flown):
    double, lanes, single, single_lanes, _, _ = flown[0]
    assert np.array_equal(double, lanes)
    assert np.array_equal(single, single_lanes)


def test_an_imu_in_single_precision_follows_double(flown):
    double, single = flown[0][4:]
    assert np.isfinite(double).all()
    assert abs(double[:100] - single[:100]).max() < 0.02
