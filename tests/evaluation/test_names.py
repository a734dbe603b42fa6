"""Tasks, laws, scenarios and rewards of a user's own: found by every command, and refused in one
line.
"""

import gymnasium as gym
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.outcomes import refused
from windwrench.controllers.registry import OWN_LAWS
from windwrench.envs.wind_scenarios import WIND_SCENARIOS
from windwrench.evaluation.benchmark import Request, fly_all
from windwrench.evaluation.episodes import fly_episode
from windwrench.evaluation.leaderboard import leaderboard
from windwrench.evaluation.rewards import find_reward, total_of
from windwrench.evaluation.tables import markdown, summary
from windwrench.evaluation.tasks import TASKS, make_pilot, scenario_names, task_of

POINT = """
import gymnasium as gym
import numpy as np


class Point(gym.Env):
    metadata = {"render_modes": [], "render_fps": 20}

    def __init__(self, render_mode=None):
        self.observation_space = gym.spaces.Box(-10.0, 10.0, (2,), np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x = self.np_random.uniform(-1.0, 1.0, 2)
        return self.x.astype(np.float32), {}

    def step(self, action):
        self.x = self.x + 0.05 * np.array([self.x[1], float(action[0])])
        reward = -float(self.x[0] ** 2)
        return self.x.astype(np.float32), reward, bool(abs(self.x[0]) > 5.0), False, {}


class Damped:
    def __call__(self, observation, info=None):
        return np.clip([-2.0 * observation.sum()], -1.0, 1.0).astype(np.float32)
"""
REGISTERED = """
gym.register("me/Point-v0", entry_point="own_points:Point", max_episode_steps=60)
"""
LANDING = """
import numpy as np
from windwrench.envs.wind_tasks import WindHoverEnv


class Landing(WindHoverEnv):
    \"\"\"Below the hover's place.\"\"\"

    name = "Landing"


def near(info):
    return {"near": 1.0 / (1.0 + 100.0 * info["error"]), "change": 2.0 * info["reward_change"]}
"""


@pytest.fixture(autouse=True)
def fresh():
    """Forget the names of a test's own."""
    before = dict(gym.registry)
    task_of.cache_clear()
    yield
    gym.registry.clear()
    gym.registry.update(before)
    task_of.cache_clear()


def written(folder, name, text):
    (folder / name).write_text(text)
    return str(folder / name)


def test_a_registered_task_without_an_error_is_flown_and_ranked_by_its_return(tmp_path):
    """By however many processes."""
    path = written(tmp_path, "own_points.py", POINT + REGISTERED)
    names = (f"{path}:Damped", "hover")
    request = Request(names, ("default",), 4, 0, "me/Point-v0", imports=(path,))
    advanced = []
    results = fly_all(request, 2, advanced.append)  # the workers run the file, too
    assert sum(advanced) == request.flights() == 8
    for each, here in zip(results.values(), fly_all(request, jobs=1).values(), strict=True):
        assert [e.total_reward for e in each] == [e.total_reward for e in here]
    rows = leaderboard(results, names, 0, "me/Point-v0")
    assert [row.controller for row in rows] == list(names)
    assert {row.ranked_by for row in rows} == {"return_mean"}
    assert rows[0].improvement_over_rival == 1.0
    assert np.isnan([rows[0].rmse_m, rows[0].iqm_rmse_m, rows[0].change_over_rival]).all()
    flown = results[names[0], "default"]
    assert rows[0].return_mean == pytest.approx(np.mean([e.total_reward for e in flown]))
    assert {e.decisions for e in flown} == {60}
    assert flown[0].time[-1] == pytest.approx(3.0)
    assert "ranked by the return" in summary(rows)
    assert "RMSE" not in markdown(rows)


def test_a_task_of_choices_is_refused():
    with refused("CartPole-v1: expected actions in a Box, got Discrete"):
        make_pilot("hover", "CartPole-v1")


def test_a_class_of_a_file_is_a_task_and_has_the_laws_of_the_kit_s_task(tmp_path):
    name = written(tmp_path, "own_landing.py", LANDING) + ":Landing"
    known = task_of(name)
    assert (known.kin, known.decisions) == ("WindHover", 500)
    assert known.laws is TASKS["WindHover"].laws
    assert known.references(["lqg"]) == ["lqg", "hover", "pid", "oracle"]
    mine, kits = (
        fly_episode(task_of(task).make("turbulent"), make_pilot("lqg", task), 7, decisions=30)
        for task in (name, "WindHover")
    )
    assert_array_equal(mine.error, kits.error)
    assert task_of("windwrench/WindHover-v1") is TASKS["WindHover"]
    envs = known.make_many(2, "base")
    observations, _ = envs.reset(seed=3)
    assert observations.shape == (2, 27)
    assert known.units(envs, known.make("base"))["largest"] == 4.0


def test_a_reward_of_one_s_own_holds_alone_and_its_terms_stand_in_info(tmp_path):
    path = written(tmp_path, "own_reward.py", LANDING)
    env = TASKS["WindHover"].make("base", f"{path}:near")
    seen = []
    flown = fly_episode(env, make_pilot("pid", "WindHover"), 3, seen.append, 20)
    assert flown.total_reward == pytest.approx(
        sum(info["reward_near"] + info["reward_change"] for info in seen)
    )
    assert seen[5]["reward_near"] == pytest.approx(1.0 / (1.0 + 100.0 * seen[5]["error"]))
    weights = written(tmp_path, "weights.yaml", "tracking: 2.0\nsquared: 3.0\n")
    info = {"reward_tracking": np.array([0.5, 0.1]), "error": np.array([0.2, 9.0])}
    total, terms = total_of(find_reward(weights), info)
    assert_allclose(total, [1.0 - 0.12, 0.2 - 3.0 * 6.25])
    assert set(terms) == {"reward_tracking", "reward_squared"}
    assert_allclose(total_of(find_reward("error"), info)[0], [0.92, 0.0], atol=1e-9)
    with refused("unknown term 'tracking'; expected one of error, squared"):
        total_of(find_reward(weights), {"error": 0.1})
    with refused("unknown reward 'eror'"):
        find_reward("eror")


def test_the_kit_s_own_file_of_scenarios_is_a_user_s(tmp_path):
    given = written(
        tmp_path,
        "mine.yaml",
        "fan: {still: {motions: [still]}}\nwind:\n  gale: &a {mean: [4.0, 5.0], turbulence: dryden}"
        "\n  foggy: {<<: *a, sigma_position: 0.02}\n",
    )
    wind = TASKS["WindHover"]
    fan = TASKS["FanTracking"]
    assert scenario_names([given, "base"], wind) == [f"{given}:gale", f"{given}:foggy", "base"]
    assert wind.scenario(f"{given}:foggy").sigma_position == 0.02
    assert fan.scenario(given).motions == ("still",)  # the only one of its kind
    with refused(r"unknown scenario .*mine\.yaml'; expected one of .*:foggy"):
        wind.scenario(given)
    with refused("gale: unknown key 'men'"):
        wind.scenario(written(tmp_path, "b.yaml", "wind: {gale: {men: [1, 2]}}\n") + ":gale")
    with refused("fan: expected scenarios by name"):
        fan.scenario(written(tmp_path, "c.yaml", "wind: {gale: {}}\n"))
    code = (
        "from windwrench.envs.wind_scenarios import WindScenario\ngale = WindScenario(wash=True)\n"
    )
    assert wind.scenario(written(tmp_path, "own_gale.py", code)).wash


def test_registered_laws_and_scenarios_and_a_law_with_gains(tmp_path, monkeypatch):
    monkeypatch.setitem(OWN_LAWS, "me/gentle", lambda: make_pilot("pid", "WindHover"))
    monkeypatch.setitem(WIND_SCENARIOS, "me/calm", WIND_SCENARIOS["calm"])
    Request(("me/gentle",), ("me/calm",), 1, 0, "WindHover").check()
    stiff = written(tmp_path, "stiff.yaml", "law: pid\ngains: {kp: 12.5}\n")
    law = make_pilot(stiff, "WindHover")
    assert (law.kp, law.ki) == (12.5, make_pilot("pid", "WindHover").ki)
    wrong = {"law: pid\ngains: {kq: 1}\n": "unknown gain 'kq'", "law: pod\n": "unknown law 'pod'"}
    for text, words in wrong.items():
        with refused(rf"wrong\.yaml.*{words}"):
            make_pilot(written(tmp_path, "wrong.yaml", text), "WindHover")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("me/Absent-v0", "unknown task 'me/Absent-v0'; expected an id registered .*--import FILE"),
        ("absent.py:Land", "absent.py: there is no such file; expected a Python file with the cla"),
        ("own_bad.py:Damped", "Damped is no task; expected a Python file with the class of a Gym"),
        ("own_bad.py:Point", "states no length of an episode; expected max_episode_steps"),
    ],
)
def test_what_is_no_task_is_refused_in_one_line(name, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, "own_bad.py", POINT)
    with refused(words):
        task_of(name)
