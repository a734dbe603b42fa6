"""A wind's profile from a flight, and the law for it: intervals that hold the truth, a loop that
flies as the task does, and no law where there is no jet.
"""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.vehicles import VEHICLE
from windwrench.controllers import Admittance
from windwrench.controllers.briefing import FilterNoise
from windwrench.envs.fan import Fan
from windwrench.evidence.profiled_fans import follows, make_env, recorded, true_profile
from windwrench.identification.jet_design import (
    _OMEGA,
    RISE_TIMES,
    fastest_followed,
    followed,
    following_loop,
    no_jet,
    shape_of,
)
from windwrench.identification.profile_law import profile_log
from windwrench.identification.wind_profile import _curve

# neither strength nor radius nor distance of the kit's own fan
FAN = Fan(speed=4.6, radius=0.37)
DISTANCE = 2.05
PLACE = np.arange(-1.5, 1.5, 0.02)
JET = 0.03 * PLACE / 0.46 * np.exp(0.5 - 0.5 * (PLACE / 0.46) ** 2)


@pytest.fixture(scope="module")
def swept():
    return profile_log(recorded(FAN, DISTANCE, "sweep", 6801, seconds=70.0), VEHICLE)


def test_the_intervals_of_a_sweep_hold_the_jet(swept):
    p = swept.profile
    true = true_profile(FAN, VEHICLE, p)
    inside = ((true > p.low) & (true < p.high)).mean(axis=1)
    assert inside[0] > 0.7
    assert inside[5] > 0.8
    # and they are narrow: a third of the largest torque at most, in the jet
    jet = np.abs(p.place) < 0.8
    assert np.max((p.high - p.low)[5, jet]) < true[5].max() / 1.5
    assert p.direction == pytest.approx(np.pi / 2, abs=0.03)
    assert p.beside == pytest.approx(DISTANCE, abs=0.05)


def test_the_jet_of_a_sweep_has_its_shape(swept):
    true = shape_of(swept.profile.place, true_profile(FAN, VEHICLE, swept.profile)[5])
    assert swept.shape.axis == pytest.approx(0.0, abs=0.08)
    assert_allclose(swept.shape.peaks, true.peaks, atol=0.12)
    assert_allclose(swept.shape.torques, true.torques, rtol=0.25)
    assert swept.shape.slope == pytest.approx(true.slope, rel=0.3)


def test_the_law_follows_slower_fans_and_loses_faster_ones(swept):
    law = Admittance(swept.law["gain"])
    fastest = swept.law["fastest_fan_m_s"]
    assert fastest < swept.law["bound_m_s"]
    env = make_env(FAN, DISTANCE)
    reach = np.array(swept.shape.edges) - swept.shape.axis
    slower, faster = (
        sum(follows(env, law, share * fastest, seed, reach) for seed in range(1_068_000, 1_068_008))
        for share in (0.75, 1.6)
    )
    assert slower >= 7
    assert faster <= 2


def test_intervals_of_correlated_errors_hold_95_percent_of_the_places():
    inside = []
    for seed in range(15):
        rng = default_rng(seed)
        t = np.arange(200 * 20) / 20.0
        place = 1.5 * np.sin(0.05 * t)
        second = t.astype(int)
        noise = np.zeros(len(t))
        for k in range(1, len(t)):  # 0.5 s
            noise[k] = 0.905 * noise[k - 1] + 0.425 * rng.standard_normal()
        y = np.interp(place, PLACE, JET) + 0.01 * noise
        means = y.reshape(200, 20).mean(axis=1)
        at = PLACE[(place.min() < PLACE) & (place.max() > PLACE)]
        mean, std, draws, samples = _curve(place, second, means, at)
        inside.append(np.mean(abs(mean - np.interp(at, PLACE, JET)) < 1.96 * std))
        assert samples < 200
        assert_allclose(draws.std(axis=0).mean(), std.mean(), rtol=0.25)
    assert 0.9 < np.mean(inside) < 0.99


@pytest.mark.parametrize(
    ("torque", "why"),
    [
        (JET, ""),
        (0.05 * JET, "not distinguishable"),
        (np.maximum(JET, 0.0), "does not change its sign"),
        (-JET, "falls across the line"),
        (np.where(PLACE > 0.3, 0.03, JET), "not fallen yet at 1.48 m"),
        (np.where(PLACE < -0.3, -0.03, JET), "not fallen yet at -1.50 m"),
    ],
    ids=["jet", "weak", "one side", "falling", "cut above", "cut below"],
)
def test_what_is_no_jet_is_told(torque, why):
    told = no_jet(PLACE, torque, np.full(len(PLACE), 0.001))
    assert why in told
    assert bool(why) == bool(told)


def test_in_calm_air_the_bound_is_the_fastest_fan():
    gains = np.array([8.0, 14.0])
    fastest = fastest_followed(
        following_loop(VEHICLE.inertia[2, 2], FilterNoise()), shape_of(PLACE, JET), gains
    )
    assert_allclose(fastest, gains * 0.03, rtol=0.12)


def test_margins_tell_where_the_loop_begins_to_swing():
    loop = following_loop(VEHICLE.inertia[2, 2], FilterNoise())
    shape = shape_of(PLACE, JET)._replace(torque=0.1 * PLACE)
    crossings = np.linspace(1.0, 6.0, 101)
    critical = crossings[np.argmax([loop.margins(c)[0] < 0.0 for c in crossings])]
    gains = np.array([0.8, 1.2]) * critical / 0.1
    _, offsets = followed(loop, shape, gains, np.zeros((2, 1)))
    assert offsets[0] < 0.1  # as at the start
    assert offsets[1] > 0.3
    # a delay as long as the margin leaves none
    margin, delay = loop.margins(1.5)
    crossed = _OMEGA[np.flatnonzero(abs(1.5 * loop.response) >= 1.0)[-1]]
    assert margin == pytest.approx(delay * crossed)
    assert (np.diff(RISE_TIMES) > 0.0).all()
