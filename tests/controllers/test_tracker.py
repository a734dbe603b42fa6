"""Trackers and oracles: their models, what they believe and are told; nothing beats the oracle."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.linalg import cholesky, lstsq
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from windwrench.controllers import InformedTracker, Limit, Tracker, TrackerLQG
from windwrench.controllers.briefing import Briefing, Motions
from windwrench.controllers.jet_map import COUNT, FIRST, STEP, jet_map
from windwrench.controllers.observation import MAX_COMMAND
from windwrench.controllers.preview import Oracle, WindOracle, preview, regulator
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.rotation import matrix_of
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.envs.scenarios import SCENARIOS
from windwrench.evaluation.episodes import fly_episode
from windwrench.evaluation.tasks import TASKS
from windwrench.evidence import boards
from windwrench.evidence.kept_results import kept

BRIEFING = Briefing()
TRACKERS = [Tracker, InformedTracker, TrackerLQG]


def test_the_map_is_what_the_environment_s_jet_does_to_the_vehicle():
    table = jet_map(BRIEFING.vehicle, BRIEFING.jet, BRIEFING.air)
    offsets = FIRST + STEP * np.arange(COUNT)
    env = FanTrackingEnv(replace(SCENARIOS["static"], offset=(0.4, 0.4), turbulence=0.0))
    felt = []
    for seed in range(4):
        env.reset(seed=seed)
        for _ in range(12):
            info = env.step(np.zeros(1, dtype=np.float32))[-1]
            offset = env.loop.position[1] - info["fan_y"]
            jet = env.loop.jet[[5, 0, 1]]
            shown = [np.interp(offset, offsets, table.mean[a]) for a in range(3)]
            felt.append((np.sign(offset) * jet[0], jet[1], np.sign(offset) * shown[0], shown[1]))
    torque, force, shown_torque, shown_force = np.mean(felt, axis=0)
    assert torque == pytest.approx(shown_torque, rel=0.05)
    assert force == pytest.approx(shown_force, rel=0.05)
    # odd and even across the axis
    assert_allclose(table.mean[0], -table.mean[0][::-1], atol=1e-9)
    assert_allclose(table.gust, table.gust[:, ::-1], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("make", TRACKERS)
def test_an_episode_does_not_depend_on_what_flew_before_or_on_global_random_numbers(make):
    env = FanTrackingEnv("base")
    pilot = make(particles=200)
    first = fly_episode(env, pilot, 5)
    np.random.seed(1)  # noqa: NPY002 - what a tracker must not look at
    fly_episode(env, pilot, 6)
    assert_array_equal(fly_episode(env, pilot, 5).command, first.command)
    assert_array_equal(fly_episode(env, make(particles=200), 5).command, first.command)


class Blind:
    """Passes the observation on and nothing else."""

    def __init__(self, pilot):
        self.pilot = pilot
        self.brief = pilot.brief
        self.reset = pilot.reset

    def __call__(self, observation, info=None):
        return self.pilot(observation)


@pytest.mark.parametrize("make", [*TRACKERS, Limit])
def test_a_tracker_does_not_look_at_the_truth(make):
    env = FanTrackingEnv("base")
    seeing, blind = (
        fly_episode(env, p, 2) for p in (make(particles=100), Blind(make(particles=100)))
    )
    assert_array_equal(seeing.command, blind.command)


def test_a_briefing_says_what_the_scenario_measures_with_and_no_more():
    env = FanTrackingEnv("noisy")
    env.reset(seed=0)
    noisy = env.briefing()
    assert (noisy.noise.position, noisy.noise.attitude) == (0.01, 0.05)
    slow = FanTrackingEnv("slow-filter")
    assert slow.briefing().noise.torque_walk == pytest.approx(noisy.noise.torque_walk * 0.45)
    base = FanTrackingEnv("base").briefing()
    standard = Briefing(base.vehicle)
    assert base.jet == standard.jet
    assert base.motions == standard.motions
    assert base.noise.torque == pytest.approx(standard.noise.torque)
    # a varied episode's own fan stays unknown
    varied = FanTrackingEnv("varied")
    varied.reset(seed=1)
    assert varied.briefing().jet == standard.jet


def test_the_limit_looks_ahead():
    """With the same beliefs and the trackers' command it is worse on fast fans."""

    class Behind(Limit):
        _command = InformedTracker._command

    env = FanTrackingEnv("fast")
    ahead, behind = (
        np.array([fly_episode(env, pilot, seed).rmse for seed in range(900_100, 900_106)])
        for pilot in (Limit(particles=500), Behind(particles=500, gain=1.6, damping=0.3))
    )
    assert ahead.mean() < 0.95 * behind.mean()


def test_the_expected_path_is_the_mean_of_all_paths():
    tracker = TrackerLQG(particles=20_000, acceleration=0.0, jumps=0.6)
    tracker._place[:], tracker._velocity[:] = 0.1, 0.3
    expected = [tracker._ahead(0.08 * k).mean() for k in range(1, 25)]
    flown = []
    for _ in expected:
        tracker._move()
        flown.append(tracker._place.mean())
    assert flown[-1] < 0.1 + 0.9 * 24 * 0.08 * 0.3  # some turned round
    assert_allclose(flown, expected, atol=0.006)


def test_a_fan_that_leaves_the_family_is_found_again():
    """It stands for 5 s and then goes, which no motion of the family does."""
    briefing = replace(BRIEFING, motions=Motions(("still",), offset=(0.0, 0.1)))
    near = replace(SCENARIOS["static"], offset=(0.0, 0.1))
    env = FanTrackingEnv(near, fan_path=lambda t: 0.2 * np.maximum(t - 4.8, 0.0))
    off = {0.0: [], 0.1: []}
    for seed in range(5):
        env.reset(seed=seed)
        steps = [env.step(np.zeros(1, dtype=np.float32)) for _ in range(90)]
        info = steps[-1][-1]
        for leave, errors in off.items():
            tracker = InformedTracker(leave=leave)
            tracker.brief(briefing)
            tracker.reset()
            for seen, *_ in steps:
                tracker(seen)
            errors.append(abs(tracker.mean[0] - (info["fan_y"] - info["y"])))
    off = {leave: np.median(errors) for leave, errors in off.items()}
    assert off[0.0] > 0.3
    assert off[0.1] < 0.15


@pytest.mark.parametrize("law", [Oracle, WindOracle])
@pytest.mark.parametrize("axis", [0, 2])
def test_the_command_is_the_first_of_those_that_are_best(law, axis):
    """Least squares over 40 commands at once, with the cost of what is left after them, agree with
    the regulator for any start and any disturbance of 12 decisions.
    """
    count = 12
    horizon = 40
    effort = 1e-4
    rng = default_rng(0)
    A, B, D = law.steps(load_vehicle("ardrone2"))[axis]
    n = len(A)
    x = rng.standard_normal(n)
    d = rng.standard_normal((count, D.shape[1]))
    weights = [np.diag(np.sqrt(np.r_[1.0, np.full(n - 1, 1e-9)]))] * horizon
    weights[-1] = cholesky(regulator(A, B, effort)[1]).T
    free = x
    moved = np.zeros((n, horizon))
    rows = []
    right = []
    for k, weight in enumerate(weights):
        free = A @ free + (D @ d[k] if k < count else 0.0)
        moved = A @ moved
        moved[:, k] += B[:, 0]
        rows.append(weight @ moved)
        right.append(-weight @ free)
    rows.append(np.sqrt(effort) * np.eye(horizon))
    right.append(np.zeros(horizon))
    best = lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0]
    gain, ahead = preview(A, B, D, effort, count)
    assert -(gain @ x + np.sum(ahead * d)) == pytest.approx(best[0], rel=1e-6)


@pytest.mark.parametrize("task", TASKS)
def test_who_foresees_nothing_is_told_what_everybody_is(task):
    plain = TASKS[task].environment("base")
    knowing = TASKS[task].environment("base")
    knowing.foresight = 3
    action = np.full(plain.action_size, 0.2, dtype=np.float32)
    for seen, told in (
        (plain.reset(seed=5), knowing.reset(seed=5)),
        (plain.step(action)[::4], knowing.step(action)[::4]),
    ):
        assert_array_equal(seen[0], told[0])
        assert seen[1].keys() < told[1].keys()
        assert {"velocity", "up", "integral"} <= told[1].keys() - seen[1].keys()


@pytest.mark.parametrize("task", TASKS)
def test_what_the_oracle_is_told_is_true(task):
    env = TASKS[task].environment("base")
    env.foresight = 4
    infos = [env.reset(seed=900_200)[1]]
    jets = []
    for k in range(12):
        *_, info = env.step(np.full(env.action_size, 0.3 * (-1) ** (k // 3), dtype=np.float32))
        infos.append(info)
        jets.append(env.loop.jet[:3].copy())
        R = matrix_of(env.loop.quaternion)
        moving = env.loop.motion[1]
        assert_array_equal(info["velocity"], moving[:3])
        assert_array_equal(info["rate"], R @ moving[3:6])
        assert_array_equal(info["up"], R[:, 2])
    if task.startswith("Wind"):
        ahead = np.array([info["wrench_ahead"][0, :3] for info in infos[:-1]])
        assert abs(ahead - jets).max() < 0.02 < 0.2 < np.abs(jets).max()  # N
        return
    assert_array_equal(infos[-1]["place"], env.loop.position)
    assert_array_equal(infos[-1]["setpoint"], env.loop.setpoint[:3])
    for k, info in enumerate(infos):
        fan = info["fan"] if "fan" in info else [info["fan_y"]]
        assert_array_equal(info["fan_ahead"][0, : len(fan)], fan)
        for later, one in enumerate(infos[k : k + 5]):
            assert_array_equal(info["fan_ahead"][later], one["fan_ahead"][0])


@pytest.mark.parametrize("task", boards.TASKS)
def test_nothing_on_the_leaderboard_beats_the_oracle(task):
    rows = kept(f"results/board/{task}.json.gz")["rows"]
    for scenario in {row["scenario"] for row in rows}:
        means = {row["controller"]: row["rmse_m"] for row in rows if row["scenario"] == scenario}
        assert min(means, key=means.__getitem__) == "oracle"


def test_a_command_stays_within_its_bounds():
    env = TASKS["FanTracking"].environment("far")
    env.foresight = Oracle().foresight
    observation, info = env.reset(seed=900_200)
    command = Oracle()(observation, info)
    assert command.shape == (1,)
    assert abs(command[0]) == MAX_COMMAND
