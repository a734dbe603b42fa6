"""Episodes of all tasks: seeds, lost vehicles, and requests that are refused."""

import numpy as np
import pytest

from windwrench.controllers import make_controller
from windwrench.dynamics import InputError
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.evaluation.benchmark import check_request, fly_all
from windwrench.evaluation.episodes import (
    DECISIONS,
    FIRST_TEST_SEED,
    benchmark_seeds,
    fly_episode,
    time_series,
)
from windwrench.evaluation.tasks import TASKS, make_pilot


def test_benchmark_episodes_are_never_those_of_training():
    assert min(benchmark_seeds(0, 10)) == FIRST_TEST_SEED
    assert not set(benchmark_seeds(0, 10_000)) & set(benchmark_seeds(1, 10_000))


class Constant:
    """A controller with one answer."""

    def __init__(self, *action):
        self.action = np.array(action)

    def reset(self):
        pass

    def __call__(self, observation, info=None):
        return self.action


@pytest.mark.parametrize(
    ("task", "scenario", "action"),
    [("FanTracking", "static", [1.0]), ("FanTracking2D", "static", [1.0, 1.0])],
)
def test_a_lost_vehicle_s_remaining_time_counts_at_two_and_a_half_metres(task, scenario, action):
    episode = fly_episode(TASKS[task].environment(scenario), Constant(*action), 0)
    assert episode.lost
    flown = len(episode.error)
    assert flown < DECISIONS == len(episode.offset)
    assert np.all(episode.offset[flown:] == 2.5)
    assert episode.offset.max() == 2.5
    square = np.sum(np.minimum(episode.error, 2.5) ** 2) + 6.25 * (DECISIONS - flown)
    assert episode.rmse == pytest.approx(np.sqrt(square / DECISIONS))
    if task == "FanTracking":
        np.testing.assert_allclose(episode.error, np.abs(episode.y - episode.fan_y))


def test_the_flight_loop_holds_against_the_largest_action_in_calm_air():
    known = TASKS["WindHover"]
    law = Constant(4.0, 0.0, 0.0)
    assert not fly_episode(known.environment("calm"), law, 0, decisions=known.decisions).lost


def test_policies_are_flown_by_their_names():
    assert make_pilot("sac-0").card["features"]["history"] > 1
    with pytest.raises(InputError, match="Did you mean 'sac-0'"):
        make_pilot("sac-00")
    with pytest.raises(InputError, match="Did you mean 'tracker'"):
        make_pilot("trakcer")


@pytest.mark.parametrize("task", TASKS)
def test_any_seed_of_32_bits_has_episodes_of_its_own(task):
    check_request(["hover"], ["base"], 1, 2**32 - 1, task)
    with pytest.raises(InputError, match="between 0 and 4294967295"):
        check_request(["hover"], ["base"], 1, 2**32, task)
    last = benchmark_seeds(2**32 - 1, 2)
    assert not set(last) & set(benchmark_seeds(2**32 - 2, 10_000))
    TASKS[task].environment("base").reset(seed=last[0])


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ((["hover"], ["base"], 0, 0), "--episodes must be at least 1"),
        ((["hover"], ["base"], 2, -1), "--seed must lie between"),
        ((["pid"], ["static"], 1, 0, 1, lambda n: None, None, "WindHover"), "unknown scenario"),
    ],
)
def test_what_cannot_be_flown_is_named(request_, words):
    with pytest.raises(InputError, match=words):
        fly_all(*request_)


@pytest.mark.parametrize(("task", "law"), [("FanTracking", "admittance"), ("WindHover", "pid")])
def test_an_episode_s_columns_are_of_one_length(task, law):
    known = TASKS[task]
    episode = fly_episode(
        known.environment("base"), make_pilot(law, task), 3, decisions=known.decisions
    )
    columns = time_series(episode)
    assert {len(column) for column in columns.values()} == {known.decisions}
    assert ("fan_y" in columns) == (task == "FanTracking")
    assert episode.time[-1] == pytest.approx(20.0)
    assert episode.total_reward <= known.decisions


def test_what_the_filter_estimates_is_what_the_agent_sees():
    episode = fly_episode(FanTrackingEnv("base"), make_controller("admittance"), 3)
    np.testing.assert_allclose(episode.estimate, episode.observation[:, :6], rtol=1e-6, atol=1e-7)
    np.testing.assert_array_equal(episode.command, episode.observation[:, 7])
