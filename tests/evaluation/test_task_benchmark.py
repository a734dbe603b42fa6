"""The leaderboards of the tasks beside FanTracking, their laws, and the search for gains."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from windwrench.controllers import wind_observation as seen
from windwrench.controllers.task_laws import TASK_LAWS, make_task_law, task_gains
from windwrench.controllers.wind_laws import INDI, PID, L1Adaptive, PIDWithForce, WindOracle
from windwrench.dynamics import InputError
from windwrench.evaluation.episodes import FIRST_TEST_SEED, benchmark_seeds
from windwrench.evaluation.side_by_side import write_leaderboard
from windwrench.evaluation.task_benchmark import (
    TASKS,
    TaskEpisode,
    check_task_request,
    fly_task,
    fly_task_episode,
)
from windwrench.evaluation.task_leaderboard import (
    draw_task_leaderboard,
    markdown,
    shown,
    summary,
    task_leaderboard,
)
from windwrench.evaluation.task_tuning import FIRST_VALIDATION_SEED, tune_task

DESIGNED = [
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
LAWS = ["hover", "pid-force", "indi", "l1", "oracle"]
EPISODES = 3


@pytest.fixture(scope="module")
def results():
    return fly_task("WindHover", LAWS, ["base"], EPISODES, seed=0, jobs=1)


def test_laws_that_know_the_wind_better_hold_better(results):
    rows = {row.controller: row for row in task_leaderboard("WindHover", results, LAWS, 0)}
    assert rows["hover"].score == 0.0
    assert rows["oracle"].score == 1.0
    for name in ("pid-force", "indi", "l1"):
        assert rows[name].rmse_m < 0.8 * rows["hover"].rmse_m
        assert rows[name].rival == "pid"
    assert math.isnan(rows["indi"].wins_over_admittance)
    wins = [
        a.rmse < b.rmse
        for a, b in zip(results["indi", "base"], results["pid", "base"], strict=True)
    ]
    assert rows["indi"].wins_over_rival == np.mean(wins)


def test_the_file_has_the_documented_keys_and_pages_have_losses(tmp_path, results):
    rows = task_leaderboard("WindHover", results, LAWS, 0)
    path = write_leaderboard(rows, tmp_path)
    written = json.loads(path.read_text(encoding="utf-8"))
    assert len(written) == len(LAWS)
    for row in written:
        assert set(DESIGNED) <= set(row)
        assert row["wins_over_admittance"] is None
    draw_task_leaderboard(rows, results, tmp_path / "a.png", 0.04)
    assert (tmp_path / "a.png").stat().st_size > 10_000
    table = markdown(rows).splitlines()
    assert "| lost |" in table[0]
    assert len(table) == 2 + len(LAWS)


def test_policies_of_a_kind_stand_together_and_their_losses_show(tmp_path):
    rng, episodes = np.random.default_rng(0), 12

    def flown(level, lost=0):
        return [
            TaskEpisode(k, k < lost, 0.0, np.full(5, level), float(level * rng.uniform(0.9, 1.1)))
            for k in range(episodes)
        ]

    policies = [f"sac-{k}" for k in range(3)]
    results = {
        (name, "base"): flown(level)
        for name, level in {"hover": 0.2, "pid": 0.1, "pid-force": 0.08, "oracle": 0.07}.items()
    }
    results |= {
        (name, "base"): flown(level, lost)
        for name, level, lost in zip(policies, (0.05, 0.06, 0.07), (0, 3, 0), strict=True)
    }
    rows = task_leaderboard("WindHover", results, ["pid", "pid-force", *policies], 0)
    sac = next(row for row in rows if row.controller == "sac")
    singles = [row for row in rows if row.controller in policies]
    assert (sac.policies, sac.best_law) == (3, "pid-force")
    assert sac.rmse_m == pytest.approx(np.mean([row.rmse_m for row in singles]))
    assert (sac.lost_fraction, sac.most_lost_fraction) == (pytest.approx(3 / 36), 3 / 12)
    low, high = sac.rmse_ci95_m
    assert all(high - low > np.ptp(row.rmse_ci95_m) for row in singles)  # other seeds, too
    assert sac.p_over_best < 0.05
    assert all(row.p_over_best is None for row in rows if row is not sac)
    assert {row.controller for row in shown(rows)} == {"sac", "pid", "pid-force"}
    assert "8.3 % (most 25.0 %)" in markdown(rows)
    told = summary(rows)
    assert "Lost: `sac` 8.3 % (most 25.0 %); `pid-force`, `pid` none." in told
    assert re.search(r"`pid-force`: clearly worse none; clearly better `sac` -\d+ %", told)
    nothing = [replace(row, lost_fraction=0.0, most_lost_fraction=0.0) for row in rows]
    assert "Lost: nothing." in summary(nothing)
    draw_task_leaderboard(rows, results, tmp_path / "a.png", 0.04)


class Deserter:
    def reset(self):
        pass

    def __call__(self, observation, info=None):
        return np.array([4.0, 0.0, 0.0])


def test_a_lost_vehicle_s_remaining_time_counts():
    task = TASKS["WindHover"]
    episode = fly_task_episode(task.environment("calm"), Deserter(), 0, task)
    assert not episode.lost  # the flight loop holds against 4 m/s2

    class Leaver(Deserter):
        def __call__(self, observation, info=None):
            return np.array([1.0, 1.0])

    task = TASKS["FanTracking2D"]
    episode = fly_task_episode(task.environment("static"), Leaver(), 0, task)
    assert episode.lost
    flown = len(episode.error)
    assert flown < task.decisions
    square = np.sum(np.minimum(episode.error, 2.5) ** 2) + 6.25 * (task.decisions - flown)
    assert episode.rmse == pytest.approx(math.sqrt(square / task.decisions))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("WindHovr", ["hover"], ["base"], 1, 0), "Did you mean 'WindHover'"),
        (("WindHover", ["admittance"], ["base"], 1, 0), "controller"),
        (("WindHover", ["pid"], ["static"], 1, 0), "scenario"),
        (("WindHover", ["pid"], ["base"], 0, 0), "--episodes"),
        (("WindHover", ["pid"], ["base"], 1, -1), "--seed"),
    ],
)
def test_what_cannot_be_flown_is_named(given, words):
    with pytest.raises(InputError, match=words):
        fly_task(*given, jobs=1)


def test_any_seed_of_32_bits_is_flown():
    check_task_request("WindHover", ["pid"], ["base"], 1, 2**32 - 1)
    with pytest.raises(InputError, match="between 0 and 4294967295"):
        check_task_request("WindHover", ["pid"], ["base"], 1, 2**32)
    for task in TASKS.values():
        assert task.environment("base").reset(seed=benchmark_seeds(2**32 - 1, 1)[0])


def test_every_law_has_gains_that_were_found_on_validation_episodes():
    assert FIRST_VALIDATION_SEED + 10_000 < FIRST_TEST_SEED
    for task, laws in TASK_LAWS.items():
        for name in laws:
            if name == "hover":
                continue
            source = "WindHover" if task == "WindTrajectory" else task
            found = task_gains()[source][name]
            assert found["rmse_m"] <= found["default_rmse_m"]
            assert f"--task {source} --laws {name} " in found["command"]
            law = make_task_law(name, task)
            for gain, value in found["gains"].items():
                assert getattr(law, gain) == value


def test_the_search_finds_better_gains_than_the_worst():
    found = tune_task("FanTracking2D", "oracle", "base", trials=4, episodes=1)
    assert found["rmse_m"] <= found["default_rmse_m"] * 1.5
    with pytest.raises(InputError, match="law"):
        tune_task("FanTracking2D", "indi")


def frame(**parts):
    o = np.zeros(seen.WIND_OBSERVATION_SIZE)
    for name, value in parts.items():
        o[getattr(seen, name)] = value
    return o


def test_pid_is_its_formula_and_its_integral_waits_at_the_limit():
    law = PID(kp=2.0, kd=3.0, ki=0.5)
    o = frame(POSITION_ERROR=[0.1, 0, 0], VELOCITY=[0, 0.2, 0], REFERENCE_VELOCITY=[0, 0, 0.1])
    first = law(o)
    np.testing.assert_allclose(first, [0.2 + 0.5 * 0.004, -0.6, 0.3], rtol=1e-6)
    np.testing.assert_allclose(law(o)[0], 0.2 + 0.5 * 0.008, rtol=1e-6)
    law.reset()
    np.testing.assert_array_equal(law(o), first)
    far = frame(POSITION_ERROR=[3.0, 0, 0])
    for _ in range(100):
        assert law(far)[0] == 4.0
    law.kp = 0.0
    assert abs(law(frame())[0]) < 0.01


def test_the_force_is_fed_forward_with_its_lead():
    law = PIDWithForce(gain=0.5, lead=0.1)
    np.testing.assert_allclose(law(frame(FORCE=[0.2, 0, 0])), [-0.5 * 0.2 / 0.465, 0, 0], rtol=1e-6)
    rate = 0.1 * 0.1 / seen.WIND_PERIOD
    expected = -0.5 * (0.3 + rate) / 0.465
    np.testing.assert_allclose(law(frame(FORCE=[0.3, 0, 0]))[0], expected, rtol=1e-6)
    oracle = WindOracle()
    with pytest.raises(InputError, match="info"):
        oracle(frame())
    np.testing.assert_allclose(
        oracle(frame(), {"force_ahead": np.array([0.0, 0.465, 0.0])}), [0, -1, 0], rtol=1e-6
    )


def test_indi_is_a_butterworth_of_the_specific_forces():
    from scipy.signal import butter, lfilter, lfilter_zi

    x = np.random.default_rng(0).standard_normal((60, 3))
    law = INDI(cutoff=4.0, gain=0.9)
    out = [law(frame(SPECIFIC_FORCE=0.1 * row, ROTOR_FORCE=0.3 * row)) for row in x]
    b, a = butter(2, 4.0, fs=1 / seen.WIND_PERIOD)
    start = lfilter_zi(b, a)[:, None] * 0.2 * x[0]
    expected, _ = lfilter(b, a, 0.2 * x, axis=0, zi=start)
    np.testing.assert_allclose(out, 0.9 * expected, atol=1e-6)


def test_l1_finds_a_constant_force_up_to_what_its_law_leaves():
    law, v, push = L1Adaptive(pole=2.0, bandwidth=8.0), np.zeros(3), np.array([0.7, -0.2, 0.1])
    action = np.zeros(3)
    law(frame(VELOCITY=v, ROTOR_FORCE=[0, 0, 9.81]))
    for _ in range(150):
        # a vehicle whose rotors follow the action at once
        rotors = action + np.array([0, 0, 9.81])
        v = v + seen.WIND_PERIOD * (action + push)
        action = law(frame(VELOCITY=v, ROTOR_FORCE=rotors)).astype(float)
    np.testing.assert_allclose(action, -math.exp(-2.0 * seen.WIND_PERIOD) * push, rtol=1e-3)


@pytest.mark.parametrize(
    "make",
    [lambda: INDI(cutoff=20.0), lambda: L1Adaptive(pole=0.0), lambda: make_task_law("x", "y")],
)
def test_gains_that_cannot_be_are_named(make):
    with pytest.raises(InputError):
        make()
