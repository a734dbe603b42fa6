"""The leaderboards of all tasks: numbers as kept, rows, pages and pictures."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

from tests.support.alike import assert_alike, strict_json
from tests.support.parameters import mostly_slow
from tests.support.paths import ROOT
from windwrench.evaluation.benchmark import Request, fly_all
from windwrench.evaluation.episodes import Episode, fly_episode
from windwrench.evaluation.leaderboard import leaderboard, shown
from windwrench.evaluation.pictures import draw_leaderboard
from windwrench.evaluation.submission import results_hash, write_submission
from windwrench.evaluation.tables import markdown, summary, write_leaderboard
from windwrench.evaluation.tasks import TASKS, short_names
from windwrench.runtime.plain_values import plain

GOLDEN = json.loads((ROOT / "tests" / "golden" / "leaderboards.json").read_bytes())
EPISODES = 2
SEED = 3
# of every row of ``leaderboard.json``, in this order
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
]


@pytest.fixture(scope="module")
def flown():
    """Of a task, what was asked for, the episodes and the rows; each task is flown once."""
    kept = {}

    def fly(task):
        if task not in kept:
            names = GOLDEN[task]["controllers"]
            scenarios = GOLDEN[task]["scenarios"]
            request = Request(tuple(names), tuple(scenarios), EPISODES, SEED, task)
            results = fly_all(request, jobs=1)
            kept[task] = names, results, leaderboard(results, names, SEED, task)
        return kept[task]

    return fly


def tolerance(controller):
    """Return by what part of a number, and by how much, another processor may differ: of three that
    were tried a law in turbulence by 5e-5, and policies, whose sums of single precision each orders
    by itself, by 2.1 % of an end of an interval.
    """
    return (5e-2, 1e-2) if re.search(r"^(sac|gru|lstm)", controller) else (2e-4, 1e-9)


@pytest.mark.parametrize("task", mostly_slow(TASKS, lambda task: task.startswith("Fan")))
def test_episodes_and_rows_are_those_that_were_kept(task, flown):
    _, results, rows = flown(task)
    episodes = {
        f"{name} {scenario}": [
            [e.seed, e.rmse, e.lost, e.total_reward, e.rmse_settled, e.command_activity]
            for e in each
        ]
        for (name, scenario), each in results.items()
    }
    assert episodes.keys() == GOLDEN[task]["episodes"].keys()
    for name, kept in GOLDEN[task]["episodes"].items():
        assert_alike(episodes[name], kept, name, *tolerance(name.partition(" ")[0]))
    # null stands for a number that means nothing
    for row, kept in zip(plain(rows), GOLDEN[task]["rows"], strict=True):
        name = kept["controller"]
        rel, least = tolerance(name)
        # a change over another controller is a difference of two numbers
        assert_alike({key: row[key] for key in kept}, kept, name, rel, max(least, 1e-4))


def test_the_file_has_the_documented_keys_and_pages_have_losses(tmp_path, flown):
    _, results, rows = flown("FanTracking")
    path = write_leaderboard(rows, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["leaderboard.json"]
    written = strict_json(path)
    assert all(list(row)[: len(KEYS)] == KEYS for row in written)
    assert written[0]["wins_over_admittance"] is not None
    draw_leaderboard(rows, results, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 1_000
    figures, compared = (part.splitlines() for part in markdown(rows).split("\n\n"))
    assert "| terminated |" in figures[0]
    assert "to the limit" in compared[0]
    for part in (figures, compared):
        assert len(part) == 2 + len(shown(rows))
        assert len({line.count("|") for line in part}) == 1


def test_where_hover_and_oracle_are_alike_there_is_no_score(flown):
    names, results, _ = flown("FanTracking2D")
    same = dict.fromkeys(results, results["hover", "base"])
    assert all(np.isnan(row.score) for row in leaderboard(same, names, SEED, "FanTracking2D"))


def episode(seed, level, lost, flown=500):
    """An episode of a constant error but for the first 3 s, where the error is 1 m."""
    n = flown
    blank = np.zeros((n, 3))
    time = 0.04 * np.arange(1, n + 1)
    return Episode(
        seed, "", lost, False, 0.0, 500, time, np.where(time <= 3.0, 1.0, level), blank,
        np.zeros((n, 4)), np.zeros((n, 6)), blank, blank, np.full(n, np.nan), blank, blank,
    )  # fmt: skip


def test_the_first_seconds_do_not_rank_and_the_rest_of_a_lost_episode_counts():
    whole = episode(0, 0.1, False)
    lost = episode(0, 0.1, True, flown=250)
    assert whole.rmse_settled == pytest.approx(0.1)
    assert (whole.rmse_transient, lost.rmse_transient) == (1.0, 1.0)
    assert whole.rmse == pytest.approx(np.sqrt(0.15 * 1.0 + 0.85 * 0.01))
    assert lost.rmse_settled == pytest.approx(np.sqrt((175 * 0.01 + 250 * 6.25) / 425))


def test_the_activity_is_that_of_the_reward_and_the_bound_is_seen():
    env = TASKS["WindHover"].make("base")
    rng = default_rng(1)
    terms = []

    def shaken(observation, info):
        return rng.choice([-9.0, 0.0, 4.0], 3, p=[0.1, 0.8, 0.1]) * (rng.random() < 0.5)

    flown = fly_episode(env, shaken, 5, lambda info: terms.append(info["reward_change"]), 60)
    cost = 0.002 * env.largest_action**2  # CHANGE_COST in m/s2
    assert -np.mean(terms) / cost == pytest.approx(flown.command_activity, rel=1e-6)
    assert flown.saturated_fraction == pytest.approx(np.mean(np.abs(flown.action).max(1) == 1.0))
    assert 0.1 < flown.saturated_fraction < 0.5


class Peeping:
    """Reads an entry of ``info``."""

    def __init__(self, read, foresight=0):
        self.read = read
        if foresight:
            self.foresight = foresight

    def __call__(self, observation, info=None):
        self.read(info)
        return np.zeros(1, dtype=np.float32)


@pytest.mark.parametrize(
    ("read", "told"),
    [
        (lambda info: info["offset"], True),
        (lambda info: info.get("fan_y"), True),
        (dict, True),
        (lambda info: {**info}, True),
        (lambda info: list(info.values()), True),
        (lambda info: (info["observation"], info["command"], "offset" in info, len(info)), False),
        (lambda info: info.get("absent"), False),
    ],
)
def test_a_law_that_reads_the_truth_is_seen(read, told):
    env = TASKS["FanTracking"].make("base")
    assert fly_episode(env, Peeping(read), 3, decisions=2).uses_truth == told
    assert fly_episode(env, Peeping(lambda info: None, 12), 3, decisions=2).uses_truth


def test_a_submission_says_what_flew_and_its_hash_is_of_the_results(tmp_path, flown):
    names, results, rows = flown("FanTracking2D")
    (tmp_path / "laws.py").write_text("")
    (tmp_path / "mine.yaml").write_text("fan: {}")
    own = [f"{tmp_path / 'laws.py'}:Still", f"{tmp_path / 'mine.yaml'}:gale"]
    request = Request((*names, own[0]), ("base", own[1]), EPISODES, SEED)
    kept = strict_json(write_submission(request, rows, results, tmp_path))
    assert kept["sha256"] == results_hash(kept)
    assert [*kept["files"]] == [str(tmp_path / name) for name in ("laws.py", "mine.yaml")]
    assert {"commit", "windwrench", "packages"} <= set(kept)
    flight = next(one for one in kept["flights"] if one["controller"] == "hover")
    assert flight["rmse_settled"] == [e.rmse_settled for e in results["hover", "base"]]
    ends = {one["controller"]: one for one in kept["over_all"]}
    assert ends["oracle"]["iqm_score"] == pytest.approx(1.0, abs=0.2)
    assert ends["oracle"]["improvement_over_rival"] == 1.0
    kept["flights"][0]["lost"][0] = 1.0
    assert kept["sha256"] != results_hash(kept)


def test_policies_of_a_kind_stand_together_and_their_losses_show(tmp_path):
    rng = default_rng(0)
    policies = [f"gru-{k}" for k in range(3)]
    levels = {"hover": 0.2, "pid": 0.1, "pid-force": 0.08, "oracle": 0.07}
    levels |= dict(zip(policies, (0.05, 0.06, 0.07), strict=True))
    results = {
        (name, "base"): [
            episode(k, level * rng.uniform(0.9, 1.1), name == "gru-1" and k < 3) for k in range(12)
        ]
        for name, level in levels.items()
    }
    rows = leaderboard(results, ["pid", "pid-force", *policies], 0, "WindHover")
    gru = next(row for row in rows if row.controller == "gru")
    singles = [row for row in rows if row.controller in policies]
    assert (gru.policies, gru.best_law) == (3, "pid-force")
    assert gru.rmse_settled_m == pytest.approx(np.mean([row.rmse_settled_m for row in singles]))
    assert (gru.lost_fraction, gru.most_lost_fraction) == (pytest.approx(3 / 36), 3 / 12)
    assert gru.lost_episodes == 3
    low, high = gru.rmse_settled_ci95_m
    assert all(high - low > np.ptp(row.rmse_settled_ci95_m) for row in singles)  # other seeds, too
    assert gru.p_over_best < 0.05
    assert all(row.p_over_best is None for row in rows if row is not gru)
    assert {row.controller for row in shown(rows)} == {"gru", "pid", "pid-force"}
    assert "| 3 of 36, most 3 of 12 |" in (page := markdown(rows))
    assert "to the limit" not in page
    assert {row["wins_over_admittance"] for row in plain(rows)} == {None}
    told = summary(rows)
    assert "Terminated: `gru` 3 of 36, most 3 of 12; `pid-force`, `pid` 0 of 12." in told
    assert re.search(r"`pid-force`: clearly worse none; clearly better `gru` -\d+ %", told)
    nothing = [replace(r, lost_fraction=0.0, most_lost_fraction=0.0, lost_episodes=0) for r in rows]
    assert "Terminated: nothing." in summary(nothing)
    draw_leaderboard(rows, results, tmp_path / "a.png")


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
