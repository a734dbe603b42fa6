"""Subclasses of tasks: many environments fly them as a single one does, or refuse them."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import TransformReward

from tests.support.vector_flights import make
from windwrench.dynamics import InputError
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.envs.lanes.vector import TaskLanes, make_vector
from windwrench.envs.task import Task
from windwrench.envs.vector import TaskVectorEnv
from windwrench.envs.wind_tasks import WindHoverEnv
from windwrench.training.training_envs import MixedFanTracking

FANS = (TaskVectorEnv, TaskLanes)
WRAPPER = "wrappers argument"


def override(base, name):
    """A task whose ``name`` is its own, and does what the base's does."""

    def method(self, *args, **kwargs):
        return getattr(base, name)(self, *args, **kwargs)

    return type("Mine", (base,), {name: method})


class Doubled(WindHoverEnv):
    """Twice the reward."""

    def step(self, action):
        seen, reward, *rest = super().step(action)
        return (seen, 2.0 * reward, *rest)


@pytest.mark.parametrize("many", FANS)
@pytest.mark.parametrize(
    "name",
    ["step", "reset", "_get_obs", "_get_info", "_told", "_look_around", "_lay_episode", "_compile"],
)
@pytest.mark.parametrize("base", [FanTrackingEnv, WindHoverEnv])
def test_a_method_that_many_never_call_is_refused_by_class_and_name(many, name, base):
    hooks = "hover and look" if many is TaskLanes else "hover, fly and look"
    told = rf"^{many.__name__}: task Mine overrides {name}, .*SyncVectorEnv.*, {hooks}$"
    with pytest.raises(InputError, match=told):
        many(2, task=override(base, name))


@pytest.mark.parametrize("name", ["fly", "draw_loop", "_begin"])
def test_lanes_refuse_what_only_environments_with_mujoco_call(name):
    mine = override(FanTrackingEnv, name)
    with pytest.raises(InputError, match=f"TaskLanes: task Mine overrides {name}"):
        make_vector(mine, 2, plant="lanes")
    make_vector(mine, 2).close()


def test_an_inherited_override_and_one_of_an_instance_are_refused():
    class Heir(Doubled):
        name = "Heir"

    class Late(WindHoverEnv):
        def __init__(self, **named):
            super().__init__(**named)
            self._get_obs = lambda: np.zeros(27, np.float32)

    for task, name in ((Heir, "step"), (Late, "_get_obs")):
        with pytest.raises(InputError, match=f"{task.__name__} overrides {name}"):
            TaskVectorEnv(2, task=task)


def test_training_s_own_task_flies_with_mujoco_alone():
    TaskVectorEnv(1, task=MixedFanTracking, scenario=("base", "fast")).close()
    with pytest.raises(InputError, match="MixedFanTracking overrides draw_loop"):
        TaskLanes(1, task=MixedFanTracking, scenario=("base", "fast"))


def test_all_methods_of_a_task_are_called_or_refused():
    """A new hook of ``Task`` is refused until the vector environment calls it."""
    own = {name for name in vars(Task) if not name.startswith("__")}
    assert TaskLanes.called < TaskVectorEnv.called < own


@pytest.mark.parametrize("given", [{}, {"plant": "lanes"}])
def test_wrappers_of_single_environments_are_refused(given):
    with pytest.raises(gym.error.Error, match=WRAPPER):
        make(2, wrappers=[lambda env: TransformReward(env, lambda r: 2 * r)], **given)


class Wide(WindHoverEnv):
    """A larger action, and a heavier vehicle, by instance and by hooks."""

    def __init__(self, **named):
        self.largest_action = 6.0
        super().__init__(**named)

    def make_loop(self, vehicle, fan, **given):
        return super().make_loop(vehicle, fan, **given)

    def hover(self):
        super().hover()
        self.reference[:, 2] += 0.1
        self.drawn_label = "higher"


@pytest.mark.parametrize("plant", ["mujoco", "lanes"])
def test_hooks_and_numbers_of_a_user_s_own_hold_in_many_as_in_a_single_one(plant):
    single, many = Wide(), make_vector(Wide, 2, plant=plant)
    frame, _ = single.reset(seed=4)
    frames, infos = many.reset(seed=4)
    assert infos["trajectory"].tolist() == ["higher"] * 2
    for action in ([5.0, 0.0, 0.0], [-7.0, 1.0, 0.0]):
        frame, reward, _, _, info = single.step(np.array(action))
        frames, rewards, _, _, infos = many.step(np.tile(action, (2, 1)))
        np.testing.assert_allclose(frames[0], frame, atol=2e-5)
        assert rewards[0] == pytest.approx(reward, abs=1e-9)
        assert infos["reference"][0, 2] == info["reference"][2]
        np.testing.assert_array_equal(infos["command"][0], info["command"])
    assert infos["command"][0].tolist() == [-6.0, 1.0, 0.0]


def test_sync_vector_env_flies_what_is_refused():
    envs = gym.vector.SyncVectorEnv([Doubled, WindHoverEnv])
    envs.reset(seed=[1, 1])
    rewards = envs.step(np.zeros((2, 3), np.float32))[1]
    assert rewards[0] == 2.0 * rewards[1]
