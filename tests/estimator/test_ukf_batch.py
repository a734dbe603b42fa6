"""A batch of filters is as many single ones; inputs that no vehicle makes, numbers at the ends of
what is stated, and what passes between Python and the core.
"""

import copy
import gc
import pickle
import tracemalloc
from math import nan

import numpy as np
import pytest
from numpy.linalg import eigvalsh, norm
from numpy.random import default_rng
from numpy.testing import assert_array_equal

from tests.support.flights import yawing_flight
from tests.support.model_flights import GUSTS
from tests.support.vehicles import HOVER, POSE, VEHICLE
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.envs import FanTrackingEnv
from windwrench.estimator import ConstantGainFilter, UKFTuning, WrenchUKF, WrenchUKFBatch
from windwrench.estimator.estimate import REJECTED

COUNT = 11  # more than are side by side at once
STEPS = 150
NAMES = ("rotors", "position", "quaternion")


def with_effects(strength):
    """A vehicle whose effects remember: the motors' lag, and drag, which keeps its
    own rotor speeds."""
    return VEHICLE.with_effects(
        EffectSetting("rotor_drag", {"kdx": strength, "kdy": strength}),
        EffectSetting("motor_lag", {"tau": 0.04}),
    )


@pytest.fixture(scope="module")
def samples():
    """Rotor speeds, positions and quaternions of some flights (STEPS, COUNT, .), with poses and
    rotor speeds missing.
    """
    flights = [yawing_flight(VEHICLE, STEPS, seed=seed) for seed in range(COUNT)]
    rotors, position, quaternion = (np.stack([f[name] for f in flights], axis=1) for name in NAMES)
    rng = default_rng(0)
    for values, share in ((rotors, 0.02), (position, 0.1), (quaternion, 0.1)):
        values[1:][rng.random((STEPS - 1, COUNT)) < share] = nan
    position[40:60, 2] = quaternion[40:60, 2] = nan
    position[70, 1] += 0.5  # an outlier
    position[15:, 4] += [2.0, 0.0, 0.0]  # a jump for good: a gate restarts the filter
    return rotors, position, quaternion


@pytest.mark.parametrize(
    ("vehicles", "gate", "tuning"),
    [
        (VEHICLE, None, None),
        (VEHICLE, 0.999, GUSTS),
        (with_effects(1e-4), None, None),
        (
            [VEHICLE, load_vehicle("hummingbird"), with_effects(1e-4), VEHICLE, with_effects(2e-4)]
            + 6 * [VEHICLE],
            None,
            None,
        ),
    ],
    ids=["one vehicle", "gusts and a gate", "effects", "one each"],
)
def test_each_is_the_single_filter_bit_for_bit(samples, vehicles, gate, tuning):
    batch = WrenchUKFBatch(vehicles, COUNT, tuning, gate=gate)
    each = vehicles if isinstance(vehicles, list) else [vehicles] * COUNT
    singles = [WrenchUKF(vehicle, tuning, gate=gate) for vehicle in each]
    rotors, position, quaternion = samples
    batch.reset(position[0], quaternion[0])
    for n, ukf in enumerate(singles):
        ukf.reset(position[0, n], quaternion[0, n])
    doubted = False
    for k in range(1, STEPS):
        together = batch.step(rotors[k], position[k], quaternion[k])
        for n, ukf in enumerate(singles):
            assert_array_equal(
                together.state[n], ukf.step(rotors[k, n], position[k, n], quaternion[k, n]).state
            )
        if k % 10 == 5 or k == STEPS - 1:  # while poses are refused, and after
            alone = [ukf.estimate for ukf in singles]
            assert_array_equal(together.std, [one.std for one in alone])
            assert_array_equal(together.std_wrench, [one.std_wrench for one in alone])
            assert_array_equal(batch.covariance, [one.covariance for one in alone])
            doubted |= bool((together.status_code == REJECTED).any())
    assert doubted or gate is None
    assert together.restarts.tolist() == [ukf.estimate.restarts for ukf in singles]
    assert together.status == [ukf.estimate.status for ukf in singles]
    assert together.restarts[4] == 1
    last = singles[-1].estimate
    vectors = ("position", "quaternion", "velocity", "angular_velocity", "torque", "force")
    assert (last.model_std > 0.0).all()
    for name in (*vectors, "nis", "model_std"):
        assert_array_equal(getattr(together, name)[-1], getattr(last, name))


QUATERNION = np.array([0.5, 0.1, -0.2, 0.8]) / norm([0.5, 0.1, -0.2, 0.8])
ARGUMENTS = np.array([380.0, 390.0, 400.0, 410.0]), np.array([0.01, 0.0, 1.0]), QUATERNION


@pytest.mark.parametrize("kind", [WrenchUKF, ConstantGainFilter])
@pytest.mark.parametrize("speed", [1e9, 1e150])
def test_one_rotor_speed_that_no_vehicle_has_changes_nothing(kind, speed):
    clean = kind(VEHICLE)
    spoiled = kind(VEHICLE)
    clean.reset(*POSE)
    spoiled.reset(*POSE)
    odd = HOVER.copy()
    odd[1] = speed
    for k in range(60):
        kept = clean.step(HOVER, *POSE).force
        found = spoiled.step(odd if k == 30 else HOVER, *POSE).force
    assert_array_equal(found, kept)


def test_masked_entries_are_not_measured():
    ukf = WrenchUKF(VEHICLE)
    ukf.reset(*POSE)
    masked = np.ma.masked_array([5.0, 0.0, 1.0], mask=[True, False, False])
    assert ukf.step(HOVER, masked, None).status == "coasting"
    speeds = np.ma.masked_array(50.0 * HOVER, mask=True)
    assert abs(ukf.step(speeds, *POSE).force).max() < 1e-6


@pytest.mark.parametrize("noise", [1e-6, 1e-8, 1e-10])
def test_the_covariance_stays_positive_with_a_noise_of_nanometres(noise):
    one = WrenchUKF(VEHICLE, UKFTuning(position_noise=noise, attitude_noise=noise))
    one.reset(*POSE)
    for k in range(400):
        estimate = one.step(HOVER, *(POSE if not 50 < k < 250 else (None, None)))
        size = np.sqrt(np.diag(estimate.covariance))
        assert size.min() > 0.0
        assert eigvalsh(estimate.covariance / np.outer(size, size))[0] > -1e-12


def test_steps_and_episodes_hold_on_to_nothing():
    """Bytes that a filter and environments hold after five times as many steps: the least of three
    times, since a leak grows in each.
    """
    ukf = WrenchUKF(VEHICLE)
    envs = FanTrackingEnv.vector(2, scenario="base")
    ukf.reset(*POSE)

    def work():
        envs.reset(seed=0)
        for _ in range(5):
            envs.step(np.zeros((2, 1), np.float32))
        for _ in range(100):
            ukf.step(HOVER, *POSE)

    work()
    tracemalloc.start()
    try:
        held = []
        for _ in range(4):
            for _ in range(5):
                work()
            gc.collect()
            held.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert np.diff(held).min() < 20_000


@pytest.mark.parametrize(
    "form",
    [
        list,
        lambda a: np.repeat(a, 2)[::2],
        lambda a: a.astype(">f8"),
        lambda a: a.astype(np.longdouble),
        lambda a: [np.array(v) for v in a],
    ],
    ids=["list", "strided", "big-endian", "long", "list of arrays"],
)
def test_any_form_of_the_same_numbers_gives_the_same_estimate(form):
    states = []
    for change in (np.asarray, form):
        estimator = WrenchUKF(VEHICLE)
        estimator.reset([0, 0, 1], QUATERNION)
        for _ in range(5):
            estimate = estimator.step(*(change(a) for a in ARGUMENTS))
        states.append(estimate.state)
    assert_array_equal(*states)


def pickled(one):
    return pickle.loads(pickle.dumps(one))


@pytest.mark.parametrize(
    ("count", "duplicate"),
    [(count, way) for count in (0, 11) for way in (copy.copy, copy.deepcopy, pickled)],
)
def test_a_copy_and_an_estimate_go_their_own_way(count, duplicate):
    """A filter with an IMU and a gate, and a batch of more than are side by side at once."""
    one = WrenchUKFBatch(VEHICLE, count) if count else WrenchUKF(VEHICLE, gate=0.999)
    one.reset([0, 0, 1], QUATERNION)

    def go_on(estimator):
        if count:
            return estimator.step(*(np.tile(values, (count, 1)) for values in ARGUMENTS))
        estimator.step(*ARGUMENTS)
        return estimator.correct_imu([0.1, 0.2, 0.3], [0.3, -0.2, 9.9])

    first = go_on(one)
    state = first.state.copy()
    covariance = one.covariance
    other = duplicate(one)
    second = go_on(one)
    assert not np.array_equal(second.state, state)
    assert_array_equal(second.state, one.estimate.state)
    after = one.covariance
    biases = None if count else one.covariance_with_biases
    go_on(one)
    assert_array_equal(first.state, state)
    assert_array_equal(other.covariance, covariance)
    assert_array_equal(go_on(other).state, second.state)
    assert_array_equal(other.covariance, after)
    if not count:
        assert_array_equal(first.covariance, covariance)
        assert_array_equal(other.covariance_with_biases, biases)
