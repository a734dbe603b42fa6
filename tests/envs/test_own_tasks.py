"""Tasks of one's own: what is overridden holds alone, side by side, and in lanes."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import TransformReward
from numpy.random import default_rng
from numpy.testing import assert_allclose

import windwrench
from tests.support.outcomes import refused
from tests.support.vector_flights import make
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.envs.state import Start
from windwrench.envs.wind_tasks import WindHoverEnv
from windwrench.training.training_envs import MixedFanTracking


class Land(windwrench.envs.Task):
    """From 1.5 m to .3 m within 10 s, softly, in the scenario's winds."""

    decision_hz = 25
    action = "acceleration"
    episode_s = 0.4

    def start(self, rng, n):
        down = np.zeros((n, 4001, 3))
        down[:, :, 2] = np.clip(1.5 - 0.0006 * np.arange(4001), 0.3, None)
        return down[:, 0], down, [self.draw_winds(rng) for _ in range(n)]

    def observe(self, s):
        return np.concatenate([s.reference[:, :3] - s.estimate.position, s.estimate.force], axis=1)

    def reward_terms(self, s):
        soft = -0.1 * s.velocity[:, 2] ** 2
        return {"tracking": 1.0 / (1.0 + (s.distance / 0.1) ** 2), "soft": soft, "cost": -0.1}

    def is_lost(self, s):
        return s.position[:, 2] < 0.1

    def info(self, s):
        return {"height": s.position[:, 2], "std": s.estimate.std_force, "error": s.distance}


gym.register("me/Land-v0", entry_point=Land, vector_entry_point=Land.vector)
WAYS = {
    "sync": {"vectorization_mode": "sync"},
    "async": {"vectorization_mode": "async"},
    "mujoco": {},
    "lanes": {"plant": "lanes"},
}


def flown(envs, decisions, seed=5):
    """Observations, rewards, ends and an own entry of ``info`` of an environment's decisions."""
    rows = []
    infos = {}
    rng = default_rng(0)
    envs.reset(seed=seed)
    for _ in range(decisions):
        actions = rng.uniform(-1.0, 1.0, (3, 3)).astype(np.float32)
        seen, rewards, lost, over, infos = envs.step(actions[: envs.num_envs])
        rows.append(np.column_stack([seen, rewards, lost, over, infos["reward_soft"]]))
    envs.close()
    return np.array(rows), infos


@pytest.mark.parametrize("way", WAYS)
def test_a_task_of_ten_lines_flies_alike_in_each_way_and_is_truncated(way):
    env = gym.make("me/Land-v0")
    frame, _ = env.reset(seed=5)
    assert frame.shape == (6,)
    rng = default_rng(0)
    alone = []
    for _ in range(10):
        action = rng.uniform(-1.0, 1.0, (3, 3)).astype(np.float32)[0]
        frame, reward, lost, over, info = env.step(action)
        assert reward == info["reward_tracking"] + info["reward_soft"] + info["reward_cost"]
        alone.append([*frame, reward, lost, over, info["reward_soft"]])
    assert (lost, over, info["reward_cost"]) == (False, True, -0.1)
    assert info["height"] == pytest.approx(1.5, abs=0.3)
    assert (info["std"] > 0.0).all()
    rows, infos = flown(gym.make_vec("me/Land-v0", num_envs=3, **WAYS[way]), 10)
    assert_allclose(rows[:, 0], alone, atol=2e-5 if way == "lanes" else 0.0)
    assert not np.array_equal(rows[:, 0], rows[:, 1])
    assert infos["height"].shape == (3,)
    assert infos["reward_cost"].tolist() == [-0.1] * 3


def test_gymnasium_s_and_sb3_s_checkers_find_nothing_wrong_with_a_task_of_one_s_own():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    check_env(gym.make("me/Land-v0").unwrapped, skip_render_check=True)
    checker.check_env(gym.make("me/Land-v0"), warn=False)


class Mine(WindHoverEnv):
    """One override each."""

    largest_action = 6.0
    decision_hz = 50.0

    def start(self, rng, n):
        start = super().start(rng, n)
        return start._replace(references=np.array(start.references) + 0.1, labels=["higher"] * n)

    def is_lost(self, s):
        return s.decision >= 3


@pytest.mark.parametrize("plant", ["mujoco", "lanes"])
def test_what_a_subclass_overrides_of_the_kit_s_task_holds_in_many_as_in_a_single_one(plant):
    single = Mine()
    many = Mine.vector(2, plant=plant)
    frame, _ = single.reset(seed=4)
    frames, infos = many.reset(seed=4)
    assert infos["trajectory"].tolist() == ["higher"] * 2
    assert_allclose(infos["reference"][0], [2.4, 0.1, 1.6])
    for k, action in enumerate(([5.0, 0.0, 0.0], [-7.0, 1.0, 0.0], [0.0, 0.0, 0.0])):
        frame, reward, lost, _, info = single.step(np.array(action))
        frames, rewards, losts, _, infos = many.step(np.tile(action, (2, 1)))
        assert_allclose(frames[0], frame, atol=2e-5)
        assert rewards[0] == pytest.approx(reward, abs=1e-9)
        assert info["time"] == 0.02 * (k + 1)
        assert (lost, losts.tolist()) == (k == 2, [k == 2] * 2)
        if k == 1:
            assert infos["command"][0].tolist() == pytest.approx([-6.0, 1.0, 0.0])


def test_an_observation_of_one_s_own_needs_no_statement_of_its_size():
    class Short(FanTrackingEnv):
        def observe(self, s):
            return s.estimate.force[:, :2]

    frame, _ = Short(normalize=True).reset(seed=0)
    assert frame.shape == Short().observation_space.shape == (2,)


WRONG = {
    "references must be": {"references": np.zeros((1, 5, 4))},
    "poses must be": {"poses": np.full((1, 4), np.nan)},
    "paths must be": {"paths": np.zeros((2, 5, 2))},
}


@pytest.mark.parametrize("said", WRONG)
def test_a_wrong_start_is_named(said):
    class Wrong(windwrench.envs.Task):
        def start(self, rng, n):
            return Start(**{"poses": np.zeros((1, 4)), **WRONG[said]})

    with refused(f"^Wrong: start: {said}"):
        Wrong().reset(seed=0)


def test_a_start_in_which_no_flight_loop_can_stay_is_refused():
    class Floor(windwrench.envs.Task):
        def start(self, rng, n):
            return Start(np.array([[0.0, 0.0, -1.0, 0.0]]))

    with refused(r"^Floor: the vehicle is lost before"):
        Floor().reset(seed=0)


@pytest.mark.parametrize("name", ["step", "reset"])
def test_a_method_that_is_not_called_side_by_side_is_refused(name):
    mine = type("Mine", (WindHoverEnv,), {name: lambda self, *_, **__: None})
    with refused(f"Mine: {name} of its own is not called side by side"):
        mine.vector(2)


def test_training_s_mixed_task_flies_with_mujoco_alone():
    MixedFanTracking.vector(1, scenario=("base", "fast")).close()
    with refused("plant='lanes' flies one scenario"):
        MixedFanTracking.vector(1, plant="lanes", scenario=("base", "fast"))


@pytest.mark.parametrize("given", [{}, {"plant": "lanes"}])
def test_wrappers_of_single_environments_are_refused(given):
    with pytest.raises(gym.error.Error, match="wrappers argument"):
        make(2, wrappers=[lambda env: TransformReward(env, lambda r: 2 * r)], **given)
