"""A batch of filters is as many single ones."""

import numpy as np
import pytest

from tests.support.flights import yawing_flight
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.estimator import WrenchUKF, WrenchUKFBatch

VEHICLE = load_vehicle("ardrone2")
COUNT, STEPS = 11, 150  # more than are side by side at once
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
    rng = np.random.default_rng(0)
    rotors[1:][rng.random((STEPS - 1, COUNT)) < 0.02] = np.nan
    position[1:][rng.random((STEPS - 1, COUNT)) < 0.1] = np.nan
    quaternion[1:][rng.random((STEPS - 1, COUNT)) < 0.1] = np.nan
    position[40:60, 2] = quaternion[40:60, 2] = np.nan
    position[70, 1] += 0.5  # an outlier
    position[15:, 4] += [2.0, 0.0, 0.0]  # a jump for good: a gate restarts the filter
    return rotors, position, quaternion


@pytest.mark.parametrize(
    ("vehicles", "gate"),
    [
        (VEHICLE, None),
        (VEHICLE, 0.999),
        (with_effects(1e-4), None),
        (
            [VEHICLE, load_vehicle("hummingbird"), with_effects(1e-4), VEHICLE, with_effects(2e-4)]
            + 6 * [VEHICLE],
            None,
        ),
    ],
    ids=["one vehicle", "gated", "effects", "one each"],
)
def test_each_is_the_single_filter_bit_for_bit(samples, vehicles, gate):
    batch = WrenchUKFBatch(vehicles, COUNT, gate=gate)
    each = vehicles if isinstance(vehicles, list) else [vehicles] * COUNT
    singles = [WrenchUKF(vehicle, gate=gate) for vehicle in each]
    rotors, position, quaternion = samples
    batch.reset(position[0], quaternion[0])
    for n, ukf in enumerate(singles):
        ukf.reset(position[0, n], quaternion[0, n])
    for k in range(1, STEPS):
        together = batch.step(rotors[k], position[k], quaternion[k])
        for n, ukf in enumerate(singles):
            np.testing.assert_array_equal(
                together.state[n], ukf.step(rotors[k, n], position[k, n], quaternion[k, n]).state
            )
    np.testing.assert_array_equal(batch.covariance, [ukf.record["P"][0] for ukf in singles])
    assert together.restarts.tolist() == [ukf.estimate.restarts for ukf in singles]
    assert together.status == [ukf.estimate.status for ukf in singles]
    assert together.restarts[4] == 1
    last = singles[-1].estimate
    vectors = ("position", "quaternion", "velocity", "angular_velocity", "torque", "force")
    for name in (*vectors, "nis"):
        np.testing.assert_array_equal(getattr(together, name)[-1], getattr(last, name))


TURNS = np.array([[0.0, 0, 1], [0, 0, 60], [0, 0, -2]])
UNKNOWN_ATTITUDES = [np.diag(np.r_[np.full(3, x), np.full(15, 1e-4)]) for x in (1e-4, 0.4, 1e-3)]


@pytest.mark.parametrize(
    ("common", "each"),
    [
        ({}, {}),
        ({"velocity": [1, 0, 0]}, {"covariance": 1e-4 * np.eye(18) * np.ones((3, 1, 1))}),
        ({}, {"angular_velocity": TURNS}),
        ({}, {"covariance": np.stack(UNKNOWN_ATTITUDES)}),
    ],
    ids=["a pose alone", "velocity and covariance", "too fast for a series", "attitude unknown"],
)
def test_it_starts_from_what_is_given_and_coasts_as_single_filters_do(common, each):
    """One may spin too fast for the series of sine and cosine; the attitude's variance is held
    where nobody measures an attitude, which only some of those side by side need.
    """
    batch, single, q = WrenchUKFBatch(VEHICLE, 3), WrenchUKF(VEHICLE), [1, 0, 0, 0]
    places = [[0, 0, n + 1] for n in range(3)]
    speeds = np.full((3, 4), 1.05 * VEHICLE.hover_rate)
    batch.reset(places, q, **common, **each)
    together = [batch.estimate, *(batch.step(speeds) for _ in range(5))]
    for n in range(3):
        single.reset(places[n], q, **common, **{name: values[n] for name, values in each.items()})
        alone = [single.estimate, *(single.step(speeds[n]) for _ in range(5))]
        for a, b in zip(together, alone, strict=True):  # an estimate stays what it was
            np.testing.assert_array_equal(a.state[n], b.state)
        np.testing.assert_array_equal(batch.covariance[n], single.covariance)
    assert len(batch) == 3
    assert np.isnan(together[-1].nis).all()
