"""The study behind the leaderboard: it goes on where it was, and its page says
what its files say."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from windwrench.controllers import Limit, Tracker
from windwrench.dynamics import InputError
from windwrench.evaluation.benchmark import fly_all
from windwrench.studies.learning.page import page as shown_of
from windwrench.studies.learning.page import verdict
from windwrench.studies.learning.scores import lines_of, overall, rows_of
from windwrench.studies.learning.study import (
    Places,
    do_entry,
    entries_of,
    fly_world,
    is_done,
    load_plan,
    read_results,
    run_study,
)
from windwrench.studies.pages import render

pytest.importorskip(
    "stable_baselines3", reason="stable_baselines3 is not installed: pip install 'windwrench[rl]'"
)

PLAN = {
    "worlds": {
        "base": {"scenario": "base"},
        "fast": {"scenario": "fast"},
        "other filter": {"scenario": "base", "estimator": "constant-gain"},
        "weak-rotor": {"scenario": "base", "effects": ["rotor_efficiency:e1=-0.08"]},
    },
    "episodes": 3,
    "designed": ["hover", "admittance", "admittance-tuned-fast", "ratio", "oracle"],
    "learned": {
        "sac": {
            "algorithm": "sac",
            "scenario": "base",
            "seeds": 2,
            "ship": True,
            "set": [
                "steps=200",
                "net=[8]",
                "validation.every=100",
                "validation.episodes=1",
                "learner.batch_size=16",
                "learner.learning_starts=50",
                "checkpoint=100",
            ],
        }
    },
    "ablation": {
        "worlds": ["base"],
        "seeds": 1,
        "algorithm": "sac",
        "scenario": "base",
        "reference": "as it is",
        "set": [
            "steps=100",
            "net=[8]",
            "validation.every=100",
            "validation.episodes=1",
            "learner.learning_starts=90",
            "learner.batch_size=16",
        ],
        "changes": {
            "truth instead": ["features.frame=[true_torque_z, true_force_x]"],
            "with deviations": ["features.frame=[torque_z, std_torque_z]"],
            "slower": ["repeat=2"],
        },
    },
}


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    root = tmp_path_factory.mktemp("study")
    places = Places(root / "runs", root / "results", root / "policies")
    entries = entries_of(PLAN)
    assert run_study([e for e in entries if e.group != "ablation"], PLAN, places, 2) == 7
    for entry in entries:
        do_entry(entry, PLAN, places)
    return places


def test_everything_is_done_once(places):
    entries = entries_of(PLAN)
    assert [e.file for e in entries if e.seed is not None][:3] == ["sac-0", "sac-1", "as-it-is-0"]
    assert all(is_done(e, PLAN, places) for e in entries)
    before = {p: p.stat().st_mtime_ns for p in places.results.iterdir()}
    assert run_study(entries, PLAN, places, 1) == 0
    assert {p: p.stat().st_mtime_ns for p in places.results.iterdir()} == before
    assert sorted(p.name for p in places.policies.iterdir()) == [
        "sac-0.json",
        "sac-0.npz",
        "sac-1.json",
        "sac-1.npz",
    ]


def test_what_is_missing_is_scored_from_the_shipped_policy(places, tmp_path):
    kept = json.loads((places.results / "sac-1.json").read_text())
    del kept["scores"]["fast"]
    other = Places(tmp_path / "no-runs", tmp_path / "results", places.policies)
    other.results.mkdir()
    (other.results / "sac-1.json").write_text(json.dumps(kept))
    entry = next(e for e in entries_of(PLAN) if e.file == "sac-1")
    assert not is_done(entry, PLAN, other)
    do_entry(entry, PLAN, other)
    assert is_done(entry, PLAN, other)
    assert json.loads((other.results / "sac-1.json").read_text()) == json.loads(
        (places.results / "sac-1.json").read_text()
    )
    assert not other.runs.exists()


def test_a_shipped_policy_reproduces_its_line(places):
    path = str(places.policies / "sac-0.npz")
    flown = fly_all([path], ["base"], 3, seed=0, jobs=1)[path, "base"]
    kept = json.loads((places.results / "sac-0.json").read_text())["scores"]["base"]
    assert kept["rmse_m"] == [round(e.rmse, 6) for e in flown]
    assert kept["lost"] == [int(e.lost) for e in flown]


def test_the_limit_says_how_uncertain_it_was():
    flown = list(fly_world(Limit(particles=60), {"scenario": "base"}, [5, 6]))
    assert all(0.01 < bound < 0.4 for _, _, bound in flown)
    assert [
        bound for _, _, bound in fly_world(Tracker(particles=10), {"scenario": "base"}, [5])
    ] == [None]


def known_errors(learned):
    """Results and plan of a study with designed laws and learned policies of known errors in m, one
    of each policy's first seed lost.
    """
    rng = np.random.default_rng(4)
    hard = rng.uniform(0.8, 1.2, 30)
    errors = {
        "hover": 0.6,
        "admittance": 0.16,
        "ratio": 0.15,
        "lead": 0.14,
        "tracker": 0.11,
        "tracker-informed": 0.095,
        "limit": 0.09,
        "oracle": 0.04,
    }
    plan = {
        "worlds": {"base": {"scenario": "base"}},
        "episodes": 30,
        "designed": list(errors),
        "learned": {name: {} for name in learned},
        "ablation": None,
    }
    results = [
        {
            "name": name,
            "group": "designed",
            "seed": None,
            "scores": {"base": {"rmse_m": list(value * hard), "lost": [0] * 30}},
        }
        for name, value in errors.items()
    ]
    for name, values in learned.items():
        for seed, value in enumerate(values):
            noisy = value * hard * rng.uniform(0.98, 1.02, 30)
            lost = [1, *[0] * 29] if seed == 0 else [0] * 30
            results.append(
                {
                    "name": name,
                    "group": "learned",
                    "seed": seed,
                    "scenario": "base",
                    "scores": {"base": {"rmse_m": list(noisy), "lost": lost}},
                }
            )
    return results, plan, hard.mean()


def test_what_learning_loses_to_stands_first_and_claims_are_corrected():
    """A learner between a tracker and the admittance law, by known errors."""
    results, plan, _ = known_errors({"sac": (0.138, 0.14, 0.142, 0.139, 0.141)})
    rows = {row.name: row for row in rows_of(results, plan)}
    sac = rows["sac"]
    assert sac.against["tracker"].interval[0] > 0.2 > sac.against["admittance"].interval[1]
    assert sac.against["lead"].interval[0] < 0.0 < sac.against["lead"].interval[1]
    assert sac.lost_fraction == pytest.approx(1 / 150)
    assert sac.lost_interval[1] > 0.0
    said = verdict(list(rows.values()), lines_of(results, plan), "base")
    assert (said["kinds"], said["worse"], said["better"]) == (1, 1, 0)
    assert said["best"].name == "sac"
    assert said["lead"] == "no clear difference"
    assert said["against_informed"].change > 0.2


def test_rows_are_those_of_the_files(places):
    results = read_results(places)
    rows = {(r.world, r.name): r for r in rows_of(results, PLAN)}
    rmse = {
        name: np.array([r["scores"]["fast"]["rmse_m"] for r in results if r["name"] == name])
        for name in ("hover", "oracle", "sac", "admittance", "admittance-tuned-fast")
    }
    row = rows["fast", "sac"]
    assert row.rmse_m == pytest.approx(rmse["sac"].mean())
    assert row.by_seed == pytest.approx(rmse["sac"].mean(axis=1))
    rival = min("admittance", "admittance-tuned-fast", key=lambda name: rmse[name].mean())
    against = row.against["admittance"]
    assert against.rival == rival
    assert against.change == pytest.approx(rmse["sac"].mean() / rmse[rival].mean() - 1)
    hover, oracle = rmse["hover"].mean(), rmse["oracle"].mean()
    assert row.score == pytest.approx((hover - rmse["sac"].mean()) / (hover - oracle))
    assert rows["base", "oracle"].score == 1.0
    assert rows["base", "hover"].score == 0.0
    assert {name for _, name in rows} == {*PLAN["designed"], "sac"}
    whole = overall(lines_of(results, PLAN), ["base", "fast"])
    assert max(whole, key=lambda name: whole[name][0]) == "oracle"
    assert set(whole) == {*PLAN["designed"], "sac"}


def test_the_page_is_made_of_results(places):
    text = render("leaderboard", shown_of(places, PLAN))
    assert "| truth instead |" in text
    assert "oracle" in text


def test_the_plan_that_comes_with_the_kit_can_be_done():
    from windwrench.controllers import CONTROLLERS
    from windwrench.dynamics.effects import parse_setting
    from windwrench.envs.scenarios import SCENARIOS
    from windwrench.training.configuration import load_config

    plan = load_plan()
    assert set(SCENARIOS) <= set(plan["worlds"])
    for world in plan["worlds"].values():
        assert world["scenario"] in SCENARIOS
        for text in world.get("effects", ()):
            parse_setting(text)
    entries = entries_of(plan)
    assert len({e.file for e in entries}) == len(entries)
    for entry in entries:
        if entry.seed is None:
            assert entry.name in CONTROLLERS
        else:
            load_config(entry.algorithm, entry.overrides)
    assert {e.algorithm for e in entries} >= {"sac", "td3", "ppo", "recurrent-ppo", "imitation"}
    assert min(sum(e.name == n for e in entries) for n in plan["learned"]) >= 5


def test_a_part_of_the_study_can_be_named(tmp_path):
    assert [e.file for e in entries_of(PLAN, ["sac-1", "hover"])] == ["hover", "sac-1"]
    with pytest.raises(InputError, match="Did you mean 'sac'"):
        entries_of(PLAN, ["sack"])
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump({"worlds": {}}), encoding="utf-8")
    with pytest.raises(InputError, match="needs ablation, designed, episodes, learned"):
        load_plan(tmp_path / "plan.yaml")
    with pytest.raises(InputError, match="cannot be read"):
        load_plan(Path(tmp_path / "none.yaml"))
