"""The leaderboards of all tasks: numbers as kept, rows, pages and pictures."""

import json
import re
from dataclasses import asdict, replace

import numpy as np
import pytest

from tests.support.alike import assert_alike, strict_json
from tests.support.parameters import mostly_slow
from tests.support.paths import ROOT
from windwrench.evaluation.benchmark import count_flights, fly_all
from windwrench.evaluation.episodes import Episode
from windwrench.evaluation.leaderboard import (
    leaderboard,
    markdown,
    shown,
    summary,
    write_leaderboard,
)
from windwrench.evaluation.pictures import draw_leaderboard
from windwrench.evaluation.tasks import TASKS, short_names

GOLDEN = json.loads((ROOT / "tests" / "golden" / "leaderboards.json").read_text(encoding="utf-8"))
EPISODES, SEED = 2, 3
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
            names, scenarios = GOLDEN[task]["controllers"], GOLDEN[task]["scenarios"]
            results = fly_all(names, scenarios, EPISODES, SEED, jobs=1, task=task)
            kept[task] = names, results, leaderboard(results, names, SEED, task)
        return kept[task]

    return fly


def tolerance(controller):
    """Return by what part of a number, and by how much, another processor may differ: of three that
    were tried a law in turbulence by 5e-5, and policies, whose sums of single precision each orders
    by itself, by 2.1 % of an end of an interval.
    """
    return (5e-2, 1e-2) if re.search(r"^(sac|gru|lstm)", controller) else (2e-4, 1e-9)


@pytest.mark.parametrize("task", mostly_slow(TASKS, lambda task: task != "WindTrajectory"))
def test_episodes_and_rows_are_those_that_were_kept(task, flown):
    _, results, rows = flown(task)
    episodes = {
        f"{name} {scenario}": [[e.seed, e.rmse, e.lost, e.total_reward] for e in each]
        for (name, scenario), each in results.items()
    }
    assert episodes.keys() == GOLDEN[task]["episodes"].keys()
    for name, kept in GOLDEN[task]["episodes"].items():
        assert_alike(episodes[name], kept, name, *tolerance(name.partition(" ")[0]))
    # null stands for a number that means nothing
    for standing, kept in zip(rows, GOLDEN[task]["rows"], strict=True):
        row = json.loads(json.dumps(asdict(standing)).replace("NaN", "null"))
        name = kept["controller"]
        rel, least = tolerance(name)
        # a change over another controller is a difference of two numbers
        assert_alike({key: row[key] for key in kept}, kept, name, rel, max(least, 1e-4))


OWN = """
import numpy as np

class Still:
    def __call__(self, observation, info=None):
        return np.zeros(2, dtype=np.float32)
"""


def test_the_number_of_processes_changes_nothing(flown, tmp_path):
    """Nor whether a law is the kit's or in a file of a user's own."""
    names, results, _ = flown("FanTracking2D")
    own, advanced = f"{tmp_path / 'laws.py'}:Still", []
    (tmp_path / "laws.py").write_text(OWN)
    laws = ["ratio", own]
    split = fly_all(laws, ["base"], EPISODES, SEED, 2, advanced.append, task="FanTracking2D")
    assert sum(advanced) == count_flights(laws, ["base"], EPISODES, "FanTracking2D") == 10
    assert set(split) == {*results, (own, "base")}
    for (name, scenario), each in split.items():
        kept = results["hover" if name == own else name, scenario]
        assert [e.rmse for e in each] == [e.rmse for e in kept]
    assert "ratio" in names


@pytest.mark.parametrize("task", ["FanTracking", "WindHover"])
def test_the_file_has_the_documented_keys_and_pages_have_losses(task, tmp_path, flown):
    _, results, rows = flown(task)
    path = write_leaderboard(rows, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["leaderboard.json"]
    written = strict_json(path)
    assert all(list(row)[: len(KEYS)] == KEYS for row in written)
    assert (written[0]["wins_over_admittance"] is None) == (task == "WindHover")
    draw_leaderboard(rows, results, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 10_000
    table = markdown(rows).splitlines()
    assert "| terminated |" in table[0]
    assert ("to the limit" in table[0]) == (task == "FanTracking")
    assert len(table) == 2 + len(shown(rows))
    assert len({line.count("|") for line in table}) == 1


def test_where_hover_and_oracle_are_alike_there_is_no_score(flown):
    names, results, _ = flown("FanTracking2D")
    same = dict.fromkeys(results, results["hover", "base"])
    assert all(np.isnan(row.score) for row in leaderboard(same, names, SEED, "FanTracking2D"))


def episode(seed, level, lost):
    """An episode of a constant error, as far as a leaderboard looks at it."""
    n = 500
    blank = np.zeros((n, 3))
    return Episode(
        seed, "", lost, 0.0, n, np.arange(n) * 0.04, np.full(n, level), blank, np.zeros((n, 4)),
        np.zeros((n, 6)), blank, blank, np.full(n, np.nan), blank,
    )  # fmt: skip


def test_policies_of_a_kind_stand_together_and_their_losses_show(tmp_path):
    rng, policies = np.random.default_rng(0), [f"gru-{k}" for k in range(3)]
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
    assert gru.rmse_m == pytest.approx(np.mean([row.rmse_m for row in singles]))
    assert (gru.lost_fraction, gru.most_lost_fraction) == (pytest.approx(3 / 36), 3 / 12)
    low, high = gru.rmse_ci95_m
    assert all(high - low > np.ptp(row.rmse_ci95_m) for row in singles)  # other seeds, too
    assert gru.p_over_best < 0.05
    assert all(row.p_over_best is None for row in rows if row is not gru)
    assert {row.controller for row in shown(rows)} == {"gru", "pid", "pid-force"}
    assert "8.3 % (most 25.0 %)" in markdown(rows)
    told = summary(rows)
    assert "Terminated: `gru` 8.3 % (most 25.0 %); `pid-force`, `pid` none." in told
    assert re.search(r"`pid-force`: clearly worse none; clearly better `gru` -\d+ %", told)
    nothing = [replace(row, lost_fraction=0.0, most_lost_fraction=0.0) for row in rows]
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
