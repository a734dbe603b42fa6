"""Trackers: their model of the filter, what they believe, and that they use nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.synthetic_wrench import TICKS, kalman_gain, observations
from windwrench.controllers import InformedTracker, Limit, Tracker
from windwrench.controllers.briefing import Air, Briefing, Motions
from windwrench.controllers.fan_motion import KINDS, place_after
from windwrench.controllers.jet_map import COUNT, FIRST, STEP, jet_map
from windwrench.controllers.observation import TORQUE_Z
from windwrench.controllers.wrench_lag import ORDER, autoregressions, axis_lag, lags
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.envs.scenarios import SCENARIOS, draw_fan_path
from windwrench.evaluation.briefing import briefing_of
from windwrench.evaluation.episodes import fly_episode

BRIEFING = Briefing()
TRACKERS = [Tracker, InformedTracker]


def test_the_map_is_what_the_environment_s_jet_does_to_the_vehicle():
    table = jet_map(BRIEFING.vehicle, BRIEFING.jet, BRIEFING.air)
    offsets = FIRST + STEP * np.arange(COUNT)
    env = FanTrackingEnv(replace(SCENARIOS["static"], offset=(0.4, 0.4), turbulence=0.0))
    felt = []
    for seed in range(4):
        env.reset(seed=seed)
        for _ in range(12):
            info = env.step(np.zeros(1, dtype=np.float32))[-1]
            offset, jet = env.loop.position[1] - info["fan_y"], env.loop.jet[[5, 0, 1]]
            shown = [np.interp(offset, offsets, table.mean[a]) for a in range(3)]
            felt.append((np.sign(offset) * jet[0], jet[1], np.sign(offset) * shown[0], shown[1]))
    torque, force, shown_torque, shown_force = np.mean(felt, axis=0)
    assert torque == pytest.approx(shown_torque, rel=0.05)
    assert force == pytest.approx(shown_force, rel=0.05)
    # odd and even across the axis
    np.testing.assert_allclose(table.mean[0], -table.mean[0][::-1], atol=1e-9)
    np.testing.assert_allclose(table.gust, table.gust[:, ::-1], rtol=1e-6, atol=1e-12)


def test_the_lag_is_that_of_the_kalman_filter_it_stands_for():
    noise, inertia, period = BRIEFING.noise, 0.0048, 0.005
    lag = axis_lag(inertia, (noise.torque, noise.torque_walk, noise.attitude), Air(), period, 16)
    A, K = kalman_gain(inertia, noise.torque, noise.torque_walk, noise.attitude, period)
    truth, guess, error, shown = np.zeros(3), np.zeros(3), np.zeros(3), []
    wrench = 0.0
    for _ in range(30):
        for k in range(16):
            truth[2] = wrench + 0.01 * (k + 1) / 16
            truth = A @ truth
            guess = A @ guess
            guess = guess + K * (truth[0] - guess[0])
        wrench += 0.01
        error = lag.keep @ error + lag.enter * 0.01
        shown.append((wrench - error[2], guess[2]))
    shown = np.array(shown)
    one_tick = 0.01 / 16
    np.testing.assert_allclose(shown[:, 0], shown[:, 1], atol=1.1 * one_tick)
    assert lag.delay * 0.01 == pytest.approx(0.3 - shown[-1, 1], rel=0.03)
    # 63 % of a step after about half of the 10-90 % rise time of 0.45 s
    assert -0.08 / np.log(np.abs(np.linalg.eigvals(lag.keep)).max()) == pytest.approx(0.2, abs=0.03)


def test_the_colour_of_the_noise_is_that_of_a_filter_that_is_run():
    still = np.ones((400, 12 * TICKS)) * -0.15
    seen = observations(still, BRIEFING, np.random.default_rng(3), turns=False)[:, :, TORQUE_Z]
    torque, _ = lags(
        BRIEFING.vehicle.mass, BRIEFING.vehicle.inertia[2, 2], BRIEFING.noise, BRIEFING.air, 0.08
    )
    table = jet_map(BRIEFING.vehicle, BRIEFING.jet, BRIEFING.air)
    gust = table.gust[0, round((0.15 - FIRST) / STEP)]
    told = 0.01**2 * torque.disturbance + gust * torque.gust + torque.pose
    apart = seen - seen.mean()
    measured = [np.mean(apart[:, j:] * apart[:, : apart.shape[1] - j]) for j in range(ORDER + 1)]
    np.testing.assert_allclose(measured, told, rtol=0.12)


def test_autoregressions_are_those_of_a_known_process():
    a, b = 1.1, -0.3
    R = np.ones(ORDER + 1)
    R[1] = a / (1 - b)
    for j in range(2, ORDER + 1):
        R[j] = a * R[j - 1] + b * R[j - 2]
    coefficients, variances = autoregressions(R)
    np.testing.assert_allclose(coefficients[2], [a, b, 0.0], atol=1e-12)
    np.testing.assert_allclose(coefficients[3], [a, b, 0.0], atol=1e-12)
    assert variances[0] == 1.0
    assert variances[1] == pytest.approx(1.0 - R[1] ** 2)
    assert variances[3] == pytest.approx(variances[2])


def moving(kind, speed, travel, start, decisions):
    """A fan's path (ticks,) m."""
    ticks = 0.005 * np.arange(decisions * TICKS)
    kinds = np.array([KINDS.index(kind)])
    along = [place_after(kinds, np.array([speed]), np.array([travel]), t)[0] for t in ticks]
    return start + np.array(along)


@pytest.mark.parametrize(
    ("make", "paths"),
    [
        (Tracker, lambda rng: moving("ramp", rng.uniform(-0.2, 0.2), 0.5, 0.0, 60)),
        (
            InformedTracker,
            lambda rng: (
                rng.choice([-1, 1])
                * moving(
                    KINDS[rng.integers(4)],
                    rng.uniform(0.05, 0.15),
                    rng.uniform(0.5, 1.2),
                    rng.uniform(-0.1, 0.1),
                    60,
                )
            ),
        ),
    ],
)
def test_what_a_tracker_believes_covers_the_truth_as_often_as_it_says(make, paths):
    rng = np.random.default_rng(11)
    fan = np.stack([paths(rng) for _ in range(40)])
    briefing = replace(BRIEFING, motions=Motions(speed=(0.05, 0.15)))
    shown = observations(fan, briefing, rng)
    tracker = make()
    tracker.brief(briefing)
    errors = []
    for path, seen in zip(fan, shown, strict=True):
        tracker.reset()
        for k, one in enumerate(seen):
            tracker(one)
            if k >= 12:
                truth = path[max(k * TICKS - 1, 0)]
                errors.append((tracker.mean[0] - truth, tracker.deviation))
    error, deviation = np.array(errors).T
    assert 0.85 <= np.mean(np.abs(error) < 2.0 * deviation) <= 0.995
    assert 0.75 <= np.sqrt(np.mean((error / deviation) ** 2)) <= 1.3
    assert np.sqrt(np.mean(error**2)) < 0.15


@pytest.mark.parametrize("make", TRACKERS)
def test_an_episode_does_not_depend_on_what_flew_before_or_on_global_random_numbers(make):
    env = FanTrackingEnv("base")
    pilot = make(particles=200)
    first = fly_episode(env, pilot, 5)
    np.random.seed(1)  # noqa: NPY002 - what a tracker must not look at
    fly_episode(env, pilot, 6)
    np.testing.assert_array_equal(fly_episode(env, pilot, 5).command, first.command)
    np.testing.assert_array_equal(fly_episode(env, make(particles=200), 5).command, first.command)


class Blind:
    """Passes the observation on and nothing else."""

    def __init__(self, pilot):
        self.pilot = pilot
        self.brief, self.reset = pilot.brief, pilot.reset

    def __call__(self, observation, info=None):
        return self.pilot(observation)


@pytest.mark.parametrize("make", [*TRACKERS, Limit])
def test_a_tracker_does_not_look_at_the_truth(make):
    env = FanTrackingEnv("base")
    seeing, blind = (
        fly_episode(env, p, 2) for p in (make(particles=100), Blind(make(particles=100)))
    )
    np.testing.assert_array_equal(seeing.command, blind.command)


def test_the_family_of_motions_is_the_scenarios_own():
    t = np.linspace(0.0, 20.0, 41)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        motion, speed, y = draw_fan_path(SCENARIOS["fast"], rng, t)
        again = np.random.default_rng(seed)
        again.integers(3)
        again.uniform(*SCENARIOS["fast"].speed)
        sign = float(again.choice([-1.0, 1.0]))
        travel = np.array([again.uniform(*Motions().travel)])
        kind = np.array([KINDS.index(motion)])
        mine = [sign * place_after(kind, np.array([speed]), travel, one)[0] for one in t]
        np.testing.assert_allclose(mine, y, atol=1e-12)


def test_a_briefing_says_what_the_scenario_measures_with_and_no_more():
    env = FanTrackingEnv("noisy")
    env.reset(seed=0)
    noisy = briefing_of(env)
    assert (noisy.noise.position, noisy.noise.attitude) == (0.01, 0.05)
    slow = FanTrackingEnv("slow-filter")
    assert briefing_of(slow).noise.torque_walk == pytest.approx(noisy.noise.torque_walk * 0.45)
    base = briefing_of(FanTrackingEnv("base"))
    standard = Briefing(base.vehicle)
    assert base.jet == standard.jet
    assert base.motions == standard.motions
    assert base.noise.torque == pytest.approx(standard.noise.torque)
    # a varied episode's own fan stays unknown
    varied = FanTrackingEnv("varied")
    varied.reset(seed=1)
    assert briefing_of(varied).jet == standard.jet


def test_only_the_limit_is_told_of_gusts():
    gusty = briefing_of(FanTrackingEnv("gusty"))
    assert gusty.air.turbulence == 0.35
    for make, told in ((Tracker, 0.10), (InformedTracker, 0.10), (Limit, 0.35)):
        pilot = make(particles=10)
        pilot.brief(gusty)
        assert pilot._briefing.air.turbulence == told


def test_a_fan_that_leaves_the_family_is_found_again():
    """It stands for 5 s and then goes, which no motion of the family does."""
    path = np.concatenate([np.zeros(60), np.cumsum(np.full(30, 0.2 * 0.08))])
    briefing = replace(BRIEFING, motions=Motions(("still",), offset=(0.0, 0.1)))
    fan = np.repeat(np.repeat(path, TICKS)[None], 5, axis=0)
    shown = observations(fan, briefing, np.random.default_rng(4), turns=False)
    off = {}
    for leave in (0.0, 0.1):
        tracker = InformedTracker(leave=leave)
        tracker.brief(briefing)
        errors = []
        for seen in shown:
            tracker.reset()
            for one in seen:
                tracker(one)
            errors.append(abs(tracker.mean[0] - path[-1]))
        off[leave] = np.median(errors)
    assert off[0.0] > 0.3
    assert off[0.1] < 0.15
