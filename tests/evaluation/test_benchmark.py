"""The leaderboard: paired episodes, scores between hover and oracle, and the file
that is written."""

import json
from dataclasses import replace

import numpy as np
import pytest

from windwrench.controllers import make_controller
from windwrench.dynamics import InputError
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.evaluation import benchmark
from windwrench.evaluation.benchmark import (
    check_request,
    count_flights,
    fly_all,
    leaderboard,
    make_pilot,
    short_names,
)
from windwrench.evaluation.episodes import DECISIONS, FIRST_TEST_SEED, benchmark_seeds, fly_episode
from windwrench.evaluation.side_by_side import write_leaderboard

NAMES = ["hover", "admittance", "ratio", "oracle"]
EPISODES = 6
KEYS = [
    "controller",
    "scenario",
    "episodes",
    "seed",
    "rmse_m",
    "rmse_ci95_m",
    "median_rmse_m",
    "lost_fraction",
    "score",
    "wins_over_admittance",
    "share_of_limit",
]


@pytest.fixture(scope="module")
def results():
    return fly_all(NAMES, ["base"], EPISODES, seed=0, jobs=1)


@pytest.fixture(scope="module")
def rows(results):
    return {row.controller: row for row in leaderboard(results, NAMES, 0)}


def test_the_oracle_beats_admittance_and_admittance_beats_hover(rows):
    assert rows["oracle"].rmse_m < rows["admittance"].rmse_m < rows["hover"].rmse_m
    assert list(rows) == sorted(rows, key=lambda name: rows[name].rmse_m)
    assert rows["oracle"].rmse_m < 0.15


def test_hover_scores_0_and_the_oracle_1(rows):
    assert rows["hover"].score == 0.0
    assert rows["oracle"].score == 1.0
    assert 0.3 < rows["admittance"].score < 1.0


def test_wins_are_counted_against_admittance(results, rows):
    assert rows["admittance"].wins_over_admittance == 0.5
    ahead = [
        o.rmse < a.rmse
        for o, a in zip(results["oracle", "base"], results["admittance", "base"], strict=True)
    ]
    assert rows["oracle"].wins_over_admittance == np.mean(ahead)


def test_a_row_sums_up_its_episodes(results, rows):
    rmse = [e.rmse for e in results["ratio", "base"]]
    row = rows["ratio"]
    assert row.episodes == EPISODES
    assert row.rmse_m == pytest.approx(np.mean(rmse))
    assert row.median_rmse_m == pytest.approx(np.median(rmse))
    assert min(rmse) <= row.rmse_ci95_m[0] <= row.rmse_m <= row.rmse_ci95_m[1] <= max(rmse)


def test_all_controllers_fly_the_same_episodes(results):
    paths = [[e.fan_y[:50] for e in results[name, "base"]] for name in NAMES]
    for other in paths[1:]:
        for a, b in zip(paths[0], other, strict=True):
            np.testing.assert_array_equal(a, b)
    assert [e.seed for e in results["hover", "base"]] == benchmark_seeds(0, EPISODES)


def test_benchmark_episodes_are_never_those_of_training():
    assert min(benchmark_seeds(0, 10)) == FIRST_TEST_SEED
    assert not set(benchmark_seeds(0, 10_000)) & set(benchmark_seeds(1, 10_000))


def test_the_number_of_processes_changes_nothing(rows):
    advanced = []
    split = fly_all(["admittance"], ["base"], EPISODES, seed=0, jobs=2, advance=advanced.append)
    assert sum(advanced) == count_flights(["admittance"], ["base"], EPISODES) == 4 * EPISODES
    assert leaderboard(split, ["admittance"], 0) == [rows["admittance"]]


def test_the_references_are_flown_though_not_asked_for(results, rows):
    some = {key: results[key] for key in results if key[0] != "ratio"}
    again = leaderboard(some, ["admittance"], 0)
    assert again == [rows["admittance"]]


class Deserter:
    """Flies away to one side."""

    def reset(self):
        pass

    def __call__(self, observation, info=None):
        return np.array([1.0])


def test_a_lost_vehicle_s_remaining_time_counts_at_two_and_a_half_metres():
    episode = fly_episode(FanTrackingEnv("static"), Deserter(), 0)
    assert episode.lost
    flown = len(episode.y)
    assert flown < DECISIONS
    assert episode.offset.shape == (DECISIONS,)
    assert np.all(episode.offset[flown:] == 2.5)
    assert episode.offset.max() == 2.5
    expected = np.sum(np.minimum(np.abs(episode.y - episode.fan_y), 2.5) ** 2) + 6.25 * (
        DECISIONS - flown
    )
    assert episode.rmse == pytest.approx(np.sqrt(expected / DECISIONS))


def test_lost_episodes_are_counted(results):
    lost = replace(results["hover", "base"][0], lost=True)
    others = [replace(e, lost=False) for e in results["hover", "base"][1:]]
    changed = {**results, ("hover", "base"): [lost, *others]}
    rows = {row.controller: row for row in leaderboard(changed, NAMES, 0)}
    assert rows["hover"].lost_fraction == pytest.approx(1 / EPISODES)


def test_the_file_has_exactly_the_documented_keys(tmp_path, rows):
    path = write_leaderboard(list(rows.values()), tmp_path)
    assert path == tmp_path / "leaderboard.json"
    written = json.loads(path.read_text(encoding="utf-8"))
    assert [list(row) for row in written] == [KEYS] * len(NAMES)
    assert [row["controller"] for row in written] == list(rows)
    assert len(written[0]["rmse_ci95_m"]) == 2
    assert [p.name for p in tmp_path.iterdir()] == ["leaderboard.json"]


def test_a_score_that_means_nothing_is_still_valid_json(tmp_path, results):
    # hover and oracle alike: nothing to score between
    same = {(name, "base"): results["hover", "base"] for name in NAMES}
    path = write_leaderboard(leaderboard(same, NAMES, 0), tmp_path)

    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    rows = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
    assert rows[0]["score"] is None
    assert rows[0]["share_of_limit"] is None


def test_the_share_of_the_way_to_the_limit(results, rows):
    rmse = {c: np.mean([e.rmse for e in results[c, "base"]]) for c in ("admittance", "limit")}
    assert rmse["limit"] < rmse["admittance"]
    assert rows["admittance"].share_of_limit == 0.0
    way = rmse["admittance"] - rmse["limit"]
    assert rows["ratio"].share_of_limit == pytest.approx(
        (rmse["admittance"] - rows["ratio"].rmse_m) / way
    )
    assert rows["oracle"].share_of_limit > 1.0  # it sees what no wrench shows
    assert leaderboard(results, ["limit"], 0)[0].share_of_limit == 1.0


def test_policies_are_flown_by_their_names(tmp_path):
    pilot = make_pilot("sac-0")
    assert pilot.card["features"]["history"] > 1
    with pytest.raises(InputError, match="Did you mean 'sac-0'"):
        make_pilot("sac-00")
    with pytest.raises(InputError, match="Did you mean 'tracker'"):
        make_pilot("trakcer")


def test_tables_show_names_and_not_paths():
    names = ["runs/a/best.npz", "runs/b/best.npz", "x/sac-0.npz", "hover", "laws.py:Mine"]
    assert short_names(names) == {
        "runs/a/best.npz": "a/best",
        "runs/b/best.npz": "b/best",
        "x/sac-0.npz": "sac-0",
        "hover": "hover",
        "laws.py:Mine": "laws.py:Mine",
    }
    assert short_names(["a/sac-0.npz", "sac-0"]) == {"a/sac-0.npz": "a/sac-0", "sac-0": "sac-0"}


def test_any_seed_of_32_bits_has_episodes_of_its_own():
    check_request(["hover"], ["base"], 1, 2**32 - 1)
    with pytest.raises(InputError, match="between 0 and 4294967295"):
        check_request(["hover"], ["base"], 1, 2**32)
    last = benchmark_seeds(2**32 - 1, 2)
    assert not set(last) & set(benchmark_seeds(2**32 - 2, 10_000))
    episode = fly_episode(FanTrackingEnv("static"), make_controller("oracle"), last[0])
    assert not episode.lost


@pytest.mark.parametrize(
    ("controllers", "scenarios", "episodes", "seed", "words"),
    [
        (["hovre"], ["base"], 2, 0, "Did you mean 'hover'"),
        (["hover"], ["bsae"], 2, 0, "Did you mean 'base'"),
        (["hover"], ["base"], 0, 0, "--episodes must be at least 1"),
        (["hover"], ["base"], 2, -1, "--seed must lie between"),
    ],
)
def test_what_cannot_be_flown_is_named(controllers, scenarios, episodes, seed, words):
    with pytest.raises(InputError, match=words):
        fly_all(controllers, scenarios, episodes, seed, jobs=1)


def test_an_episode_s_arrays_are_of_one_length():
    episode = fly_episode(FanTrackingEnv("base"), make_controller("admittance"), 3)
    lengths = {
        len(getattr(episode, name))
        for name in ("time", "y", "fan_y", "command", "observation", "force", "torque")
    }
    assert lengths == {DECISIONS}
    assert episode.time[-1] == pytest.approx(20.0)
    assert episode.total_reward <= DECISIONS


def test_a_stated_duration_holds_no_compiling(monkeypatch):
    """What a flight compiles on its way is not counted, wherever on the way."""
    now, known = 0.0, 0

    def fly(env, controller, seed, decisions):
        nonlocal now, known
        now += 0.01 * decisions + 60.0 * max(0, decisions - known)
        known = max(known, decisions)

    monkeypatch.setattr(benchmark, "is_on_disk", lambda function: True)
    monkeypatch.setattr(benchmark, "fly_episode", fly)
    monkeypatch.setattr(benchmark.time, "perf_counter", lambda: now)
    controllers = len({"hover", *benchmark._REFERENCES})
    seconds = benchmark.sampled_seconds(["hover"], ["base"], 1, jobs=1)
    assert seconds == pytest.approx(controllers * 0.01 * DECISIONS)
