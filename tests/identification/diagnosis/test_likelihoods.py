"""The evidence of sets against integrals by numbers, and that of the force balance on flights whose
forces are known by construction.
"""

import math
from dataclasses import replace
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.linalg import norm, slogdet, solve
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.diagnosis.column import Product
from windwrench.identification.diagnosis.evidence import (
    Marginal,
    evidence_of_one_more,
    tempering,
)
from windwrench.identification.diagnosis.left_out import LeftOut
from windwrench.identification.diagnosis.priors import Base
from windwrench.identification.diagnosis.regression import RegressedFlights
from windwrench.identification.diagnosis.row_noise import RowNoise
from windwrench.identification.diagnosis.rows import Rows
from windwrench.identification.diagnosis.settings import DiagnosisSettings
from windwrench.identification.logs.flight_log import FlightLog


def by_numbers(normal, right, low, high):
    """The integral of the likelihood over a normal prior that is cut off at its bounds."""

    def density(z):
        return math.exp(right * z - 0.5 * normal * z * z - 0.5 * z * z)

    low = max(low, -12.0)
    high = min(high, 12.0)
    share = quad(lambda z: math.exp(-0.5 * z * z), low, high)[0]
    return math.log(quad(density, low, high)[0] / share)


@pytest.mark.parametrize(("right", "low"), [(3.0, -inf), (-4.0, 0.0), (-0.5, -inf)])
def test_the_evidence_of_one_coefficient_is_the_integral(right, low):
    bounds = np.array([low]), np.array([inf])
    m = Marginal({0: 0}, *bounds, np.array([[2.0]]), np.array([right]), 0.0, 0.0)
    found = m.evidence([0])
    assert found.log_evidence == pytest.approx(by_numbers(2.0, right, low, inf), abs=1e-6)
    assert found.mode[0] == pytest.approx(max(right / 3.0, low))


@pytest.mark.parametrize("seed", range(6))
def test_the_mode_of_many_coefficients_is_the_best_within_bounds(seed):
    rng = default_rng(seed)
    x = rng.standard_normal((30, 9)) @ np.diag(np.geomspace(0.1, 30.0, 9))
    y = x @ rng.standard_normal(9) + rng.standard_normal(30)
    low = -np.abs(rng.standard_normal(9))
    high = np.where(rng.random(9) < 0.5, inf, 0.5 * np.abs(rng.standard_normal(9)))
    index = [8, 0, 3, 5, 1, 6]
    place = dict(enumerate(range(len(low))))
    found = Marginal(place, low, high, x.T @ x, x.T @ y, 0.0, 0.0).evidence(index)
    # least squares, with the prior as further rows
    A = np.vstack([x[:, index], np.eye(6)])
    best = lsq_linear(A, np.append(y, np.zeros(6)), (low[index], high[index]), tol=1e-14)
    assert_allclose(found.mode, best.x, rtol=1e-7, atol=1e-8)
    assert_allclose(found.std, np.sqrt(np.diag(np.linalg.inv(A.T @ A))), rtol=1e-9)
    unbounded = Marginal(place, 0 * low - inf, 0 * low + inf, x.T @ x, x.T @ y, 0.0, 0.0)
    free = unbounded.evidence(index)
    assert_allclose(free.mode, solve(A.T @ A, x[:, index].T @ y), rtol=1e-9)
    gained = 0.5 * free.mode @ (x[:, index].T @ y) - 0.5 * slogdet(A.T @ A)[1]
    assert free.log_evidence == pytest.approx(gained)


@pytest.mark.parametrize("blocks", [1, 5])
def test_deviations_hold_a_coefficient_that_changes(blocks):
    """The number changes from block to block, or from one flight of five blocks to the next."""
    rng = default_rng(blocks)
    flight = np.arange(40) // blocks
    column = ("mass", "dm")
    off = []
    for _ in range(100):
        x = rng.standard_normal((40, 50, 2))
        x[:, :, 1] += 0.5 * rng.standard_normal(40)[flight, None] * x[:, :, 0]
        sums = x.swapaxes(1, 2) @ x
        one, none = np.ones(1), np.arange(0)
        base = Base([column], one, -inf * one, inf * one, sums.sum(axis=0), sums, flight,
                    np.arange(1), 0.0, frozenset(), none, one, [], {})  # fmt: skip
        found = base.marginal([column], none).evidence([column])
        wide = base.scatter([column], found.mode, 1.0)
        off.append(found.mode / found.std / np.array([1.0, wide[0]]))
    stated, widened = np.mean(np.abs(off) > 2.0, axis=0)
    assert stated > 0.3
    assert widened < 0.12


def test_columns_that_no_prior_tells_apart_have_no_evidence():
    bounds = np.full(2, -inf), np.full(2, inf)
    both = Marginal({0: 0, 1: 1}, *bounds, np.full((2, 2), -2.0), np.ones(2), 0.0, 0.0)
    with pytest.raises(np.linalg.LinAlgError, match="tells columns of the set apart"):
        both.evidence([0, 1])


def test_a_likelihood_is_tempered_where_its_scores_scatter_too_much():
    rng = default_rng(2)
    x = rng.standard_normal((40, 100, 3))
    noise = rng.standard_normal((40, 100))
    alike = np.repeat(rng.standard_normal((40, 5)), 20, axis=1)  # one error for 20 samples
    slow = np.repeat(rng.standard_normal((40, 5, 3)), 20, axis=1)

    def power(x, y):
        both = np.concatenate([x, y[..., None]], axis=2)
        return tempering(np.einsum("bni,bnj->bij", both, both), np.arange(3))

    assert power(x, noise) > 0.75
    assert power(slow, alike) < 0.1


def test_a_coefficient_helps_where_blocks_agree_on_it():
    rng = default_rng(6)
    x = rng.standard_normal((12, 40, 3))
    # one coefficient everywhere, and one whose sign each block draws
    x[..., 2] += 0.4 * x[..., 0] + x[..., 1] * rng.choice([-0.4, 0.4], (12, 1))
    blocks = np.einsum("bni,bnj->bij", x, x)
    base = SimpleNamespace(
        blocks=blocks, flight=np.arange(12) % 3, single=[0, 1], plain=[], at=lambda c: [0, 1]
    )
    base.low, base.high = np.array([[-inf], [inf]]) * np.ones(2)
    left_out = LeftOut(base, [0, 1], 1.0)
    (steady, std), (erratic, spread) = (left_out.gain([i]) for i in (1, 0))
    assert steady > left_out.least * std
    assert erratic < left_out.least * spread


def test_one_more_column_is_worth_the_mean_of_its_bayes_factors():
    rng = default_rng(4)
    x = rng.standard_normal((200, 4))
    y = rng.standard_normal(200)
    y += 0.4 * x[:, 3]
    normal = x.T @ x
    right = x.T @ y

    def evidence(columns, size):
        at = np.array(columns)
        own = np.array([1.0, 1.0, size])[: len(at)]
        inner = normal[np.ix_(at, at)] * own[:, None] * own + np.eye(len(at))
        b = right[at] * own
        return 0.5 * b @ solve(inner, b) - 0.5 * slogdet(inner)[1]

    sizes = (0.1, 1.0)
    products = np.block([[normal, right[:, None]], [right, 0.0]])
    bounds = np.full(2, -inf), np.full(2, inf)
    m = Marginal.of([2, 3], bounds, products, np.array([2, 3]), np.array([0, 1]), np.ones(2))
    found = evidence_of_one_more(m, [0, 1], sizes)
    each = [evidence([0, 1, c], s) - evidence([0, 1], s) for c in (2, 3) for s in sizes]
    assert found == pytest.approx(np.logaddexp.reduce(each) - math.log(4.0))
    assert found > 5.0
    assert evidence_of_one_more(m, [0], sizes) < 0.0


DRAG = 0.12  # N/(m/s)^2
LAW = EffectSetting("body_drag", dict(dx=0.0, dy=0.0, dz=0.0, cx=DRAG, cy=DRAG, cz=DRAG))
VEHICLE = replace(load_vehicle("ardrone2"), effects=(LAW,))


def flown(wind=(0.0, 0.0, 0.0), seconds=25.0, pose_noise=3e-4, imu=False, seed=1):
    """A flight in which thrust and attitude are what the forces ask for; rotors by commands."""
    rng = default_rng(seed)
    t = np.arange(0.0, seconds, 0.01)
    angle = np.outer(t, [0.9, 1.4, 0.5])
    phase = [0.0, 0.6, 1.1]
    place = [1.2, 0.7, 0.4] * (np.sin(angle + phase) + 0.5 * np.sin(1.7 * angle + phase))
    place[:, 2] += 2.0
    speed = np.gradient(place, t, axis=0)
    gust = 3e-4 * VEHICLE.weight * np.cumsum(rng.standard_normal(place.shape), axis=0)
    gust -= np.linspace(0.0, 1.0, len(t))[:, None] * gust[-1]
    past = np.array(wind) - speed
    air = norm(past, axis=1)[:, None] * DRAG * past
    need = VEHICLE.mass * np.gradient(speed, t, axis=0) + [0.0, 0.0, VEHICLE.weight] - air - gust
    thrust = norm(need, axis=1)
    z = need / thrust[:, None]
    y = np.cross(z, [1.0, 0.0, 0.0])
    y /= norm(y, axis=1)[:, None]
    rotation = np.stack([np.cross(y, z), y, z], axis=2)
    turned = Rotation.from_rotvec(pose_noise * rng.standard_normal(place.shape))
    q = (Rotation.from_matrix(rotation) * turned).as_quat(scalar_first=True)
    speeds = np.sqrt(thrust / np.sum(VEHICLE.k))
    log = FlightLog(
        t,
        place + pose_noise * rng.standard_normal(place.shape),
        q,
        np.repeat(speeds[:, None], 4, axis=1),
        commanded=True,
        name="flown",
    )
    if not imu:
        return log
    felt = np.einsum("nji,nj->ni", rotation, need + air + gust) / VEHICLE.mass
    noisy = felt + [0.15, -0.1, 0.2] + 0.05 * rng.standard_normal(felt.shape)
    return replace(log, accelerometer=noisy, gyro=np.zeros_like(felt))


@pytest.mark.parametrize("swing", [pytest.param(0.0, marks=pytest.mark.slow), 1.8])
def test_a_wind_is_no_drag_and_no_tilt(swing):
    """The swing is in step with the flight; nothing is sure where more seconds are asked for."""
    t = np.arange(0.0, 25.0, 0.01)
    gusty = np.outer(swing * np.sin(0.9 * t + 1.6) - 6.0, [1.0, 0.0, 0.0])
    asked = DiagnosisSettings(least_seconds=26.0)
    found = diagnose([flown(wind=gusty)], VEHICLE, settings=asked)
    assert all(e.tentative for e in found.effects)
    assert "short" in found.doubts
    named = {e.name: e for e in found.effects}
    wind = named["wind"]
    assert wind.coefficients["wx"] == pytest.approx(-6.0, abs=2.0 * wind.std["wx"])
    assert wind.std["wx"] < 0.8
    assert not named.keys() & {
        "world_tilt",
        "thrust_axis_tilt",
        "body_drag",
        "rotor_drag",
        "constant_force",
    }
    assert found.probabilities.names["wind"] > 0.8
    assert found.after.force_rms < (0.2 + swing / 12.0) * found.before.force_rms


@pytest.mark.slow
def test_a_drag_that_nobody_declared_is_sure():
    """On five of six flights; on one the gust looks like a part that swings."""
    bare = replace(VEHICLE, effects=())
    sure = 0
    for seed in (1, 2, 3):
        found = diagnose([flown(seed=seed)], bare)
        drags = [e for e in found.effects if e.name in ("body_drag", "rotor_drag")]
        assert drags
        sure += any(not e.tentative for e in drags)
        assert found.after.force_rms < 0.5 * found.before.force_rms
    assert sure > 1


def test_the_accelerometer_is_read_beside_the_pose():
    rows = Rows(RegressedFlights([flown(seconds=40.0, imu=True)], VEHICLE), {})
    assert rows.channels == 6
    left = rows.residual({})[rows.fit]
    # its bias is in its channels, and only there; the gust is in both
    off = (left[:, 3:] - left[:, :3]).mean(axis=0)
    assert_allclose(off, [0.15, -0.1, 0.2], atol=0.01)
    assert np.corrcoef(left[:, 0], left[:, 3])[0, 1] > 0.85


def test_the_noise_of_an_autoregression_is_found():
    rng = default_rng(4)
    lag = np.array([[0.7, 0.2], [0.0, 0.4]])
    root = np.array([[1.0, 0.0], [0.8, 0.5]])
    x = np.zeros((12000, 2))
    for k in range(1, len(x)):
        x[k] = lag @ x[k - 1] + root @ rng.standard_normal(2)
    begins = np.arange(len(x)) == 0
    begins[5000] = True
    found = RowNoise.fitted(x, begins, np.arange(len(x)) % 400 < 300, np.zeros(2))
    assert_allclose(found.lags[0], lag, atol=0.06)
    assert_allclose(found.covariance, root @ root.T, atol=0.06)
    assert_allclose(np.cov(found.white(x)[found.known].T), np.eye(2), atol=0.15)
    assert not found.known[:3].any()
    assert not found.known[5000:5003].any()


def test_a_column_of_factors_is_their_product_a_part_at_a_time():
    rng = default_rng(3)
    z = rng.normal(size=50)
    turned = rng.normal(size=(50, 3))
    force = Product(1.7, z, turned)
    torque = Product(0.3, z, Product.ones(50, 1), 4)
    dense = np.zeros((2, 50, 6))
    dense[0, :, :3], dense[1, :, 4] = 1.7 * z[:, None] * turned, 0.3 * z
    for rows in (slice(None), slice(7, 31)):
        assert_array_equal(force.part(rows).whole, dense[0, rows])
        assert_array_equal(torque.part(rows).whole, dense[1, rows])
