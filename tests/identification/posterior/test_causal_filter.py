"""The filter follows poses that were made, and its sensitivities are derivatives of it."""

import numpy as np
import pytest

from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.identification.posterior.axis_filter import steady_noise
from windwrench.identification.posterior.causal_filter import Poses, run, sensitivities
from windwrench.identification.posterior.rotor_innovations import FEEDBACK, rotor_innovations

PERIOD, COUNT = 0.005, 600
PUSH = 0.4  # m/s2, along x, from the first sample on


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("ardrone2")


def hovering(vehicle, speeds=None):
    """Level poses without noise, pushed along x."""
    count = COUNT if speeds is None else len(speeds)
    t = PERIOD * np.arange(count)
    position = np.zeros((count, 3))
    position[:, 0] = 0.5 * PUSH * t**2
    hover = np.sqrt(vehicle.weight / np.sum(vehicle.k))
    return Poses(
        t,
        PERIOD,
        position,
        np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        np.full((count, 4), hover) if speeds is None else speeds,
        np.zeros(count),
        np.zeros(3),
        np.zeros(3),
    )


def noise():
    return tuple(
        steady_noise(1e-3, 0.3 if axis < 3 else 3.0, 3.0, 1e-6, PERIOD) for axis in range(6)
    )


def test_a_push_becomes_the_disturbance(vehicle):
    track = run(hovering(vehicle), vehicle, noise())
    disturbance = track.acceleration - track.model
    assert disturbance[-1, 0] == pytest.approx(PUSH, rel=0.1)
    assert np.abs(disturbance[-1, 1:]).max() < 1e-3
    assert np.abs(track.innovations[-1]).max() < 1e-3


def test_a_prediction_knows_nothing_of_its_own_pose(vehicle):
    poses = hovering(vehicle)
    before = run(poses, vehicle, noise())
    moved = poses.position.copy()
    moved[300:, 1] += 0.05
    after = run(
        Poses(PERIOD * np.arange(COUNT), PERIOD, moved, *list(poses.__dict__.values())[3:]),
        vehicle,
        noise(),
    )
    np.testing.assert_array_equal(before.predicted[:301], after.predicted[:301])
    assert after.innovations[300, 1] == pytest.approx(0.05)


def test_sensitivities_are_derivatives_of_the_predictions(vehicle):
    size = 0.02
    pushed = vehicle.with_effects(EffectSetting("constant_force", {"fy": size * vehicle.mass}))
    poses, six = hovering(vehicle), noise()
    track, other = run(poses, vehicle, six), run(poses, pushed, six)
    acting = np.zeros((COUNT, 6, 1))
    acting[:, 1] = 1.0
    out = np.empty((COUNT, 6, 1))
    sensitivities(
        PERIOD,
        np.array([x.gain for x in six]),
        np.exp(-PERIOD / np.array([x.time for x in six])),
        np.zeros((COUNT, 3, 2)),
        track.angular_velocity,
        acting,
        np.zeros((COUNT, 6, 0)),
        np.zeros((COUNT, 6, 0)),
        np.zeros(0, dtype=np.int64),
        np.zeros((6, 3, 1)),
        out,
    )
    change = other.predicted[:, 1] - track.predicted[:, 1]
    np.testing.assert_allclose(change, size * out[:, 1, 0], atol=1e-9)


def test_only_what_the_past_does_not_predict_is_a_rotors_innovation(vehicle):
    count = 10 * COUNT
    rng = np.random.default_rng(2)
    hover = np.sqrt(vehicle.weight / np.sum(vehicle.k))
    steps = 0.1 * rng.standard_normal((count, 4))
    speeds = np.full((count, 4), hover)
    for k in range(1, count):
        speeds[k] = hover + 0.9 * (speeds[k - 1] - hover) + steps[k]
    poses = hovering(vehicle, speeds)
    inertias = np.array([vehicle.mass, *np.diagonal(vehicle.inertia)])
    (found,) = rotor_innovations([(poses, run(poses, vehicle, noise()))], inertias)
    drawn = vehicle.rotor_wrench(hover + steps) - vehicle.rotor_wrench(np.full((1, 4), hover))
    kept = slice(FEEDBACK.lags, None)
    for i in range(4):
        assert np.corrcoef(found[kept, i], drawn[kept, i])[0, 1] > 0.9
    assert found[: FEEDBACK.lags].any() == False  # noqa: E712
