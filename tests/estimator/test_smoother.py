"""The fixed-interval smoother across gaps, blocks and unlikely poses.

``test_ukf.py`` holds the smoother to the literal one, ``test_wrench_series.py`` a smoothed log to
its parts before and after a restart.
"""

from math import nan

import numpy as np
import pytest
from numpy.linalg import eigvalsh, inv
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.model_flights import (
    YAWED,
    simulate_model,
)
from tests.support.vehicles import VEHICLE
from windwrench import _core
from windwrench.envs.recording import record_flight
from windwrench.estimator import UKFTuning, smoother
from windwrench.estimator.row_steps import steps_between
from windwrench.estimator.smoother import RecordingUKF


def model_log(steps, seed=1):
    """Return the arguments of ``smooth`` for a run drawn from the model."""
    hover = np.full((steps, 4), VEHICLE.hover_rate)
    return simulate_model(VEHICLE, UKFTuning(), hover, seed=seed, **YAWED).log()


def smooth(t, speeds, x, q):
    """Return the smoothed estimate at the rows of a log, with its covariance."""
    ukf = RecordingUKF(VEHICLE, None, float(np.median(np.diff(t))))
    ukf.reset(x[0], q[0])
    events = [ukf.events - 1]
    for k in range(1, len(t)):
        for step in steps_between(t[k] - t[k - 1], ukf.period):
            ukf.predict(0.5 * (speeds[k - 1] + speeds[k]), step)
        ukf.correct(x[k], q[k])
        events.append(ukf.events - 1)
    return ukf.smooth(events, True)


def test_a_link_is_cut_where_there_is_no_joint_distribution():
    """As between a covariance and one that was held at a bound."""
    rng = default_rng(0)
    A = rng.standard_normal((18, 18))
    P = A @ A.T + np.eye(18)
    F = np.eye(18) + 0.1 * rng.standard_normal((18, 18))
    G = np.empty((18, 18))
    K = np.empty((18, 18))
    C = P @ F.T
    after = F @ P @ F.T + np.eye(18)
    _core.link_back(P, C, after, G, K)
    gain = C @ inv(after)
    assert np.allclose(G.T, gain)
    assert np.allclose(K, P - gain @ C.T, atol=1e-9)
    _core.link_back(P, C, 0.5 * after, G, K)
    assert not G.any()
    assert np.array_equal(K, P)
    _core.link_back(P, C, np.full((18, 18), nan), G, K)
    assert not G.any()


@pytest.mark.parametrize("block", [1, 7])
def test_blocks_change_nothing(block, monkeypatch):
    log = model_log(300)
    log[2][100:120] = nan
    whole = smooth(*log)
    monkeypatch.setattr(smoother, "_BLOCK", block)
    pieces = smooth(*log)
    assert np.array_equal(whole.state, pieces.state, equal_nan=True)
    assert np.array_equal(whole.covariance, pieces.covariance)


def test_unlikely_poses_widen_what_is_smoothed_before_and_after():
    """A pose that stands still for 0.4 s at 1.5 m/s: without the widening z is 37."""
    flown = record_flight(VEHICLE, (), "circle", 6.0)
    x = flown["position"]
    q = flown["quaternion"]
    x[800:880] = x[800]
    q[800:880] = q[800]
    ukf = RecordingUKF(VEHICLE, gate=0.9999)
    ukf.reset(x[0], q[0])
    for k in range(1, len(x)):
        ukf.step(flown["rotor_speeds"][k], x[k], q[k])
    found = ukf.smooth(covariance=True)
    z = abs(found.force - flown["force"]) / found.std_force
    assert z[800:].max() < 6.0
    assert z[700:800].max() < 6.0
    diagonal = np.diagonal(found.covariance, axis1=1, axis2=2)
    assert_allclose(found.std**2, diagonal, rtol=1e-12)


@pytest.mark.parametrize("seed", [0, 2, 5])
def test_covariances_stay_positive_definite_whatever_was_flown(seed):
    rng = default_rng(seed)
    _, speeds, x, q = model_log(400, seed)
    x += np.cumsum(rng.choice([0.0, 1.0], (400, 1), p=[0.98, 0.02]) * rng.normal(0, 2, (400, 3)), 0)
    lost = slice(150, 150 + 40 * (seed + 1))
    x[lost] = nan
    q[lost] = nan
    t = np.cumsum(rng.choice([0.001, 0.005, 0.02], 400))
    found = smooth(t, speeds, x, q)
    assert np.isfinite(found.state[:, :19]).all()
    scale = 1.0 / found.std
    assert eigvalsh(found.covariance * scale[:, :, None] * scale[:, None, :]).min() > 0
