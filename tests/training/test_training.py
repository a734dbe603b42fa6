"""Training: configurations, the update, exact resumption and what is refused of a spoiled folder,
policies that fly as the learner would, and environments as stable-baselines3 sees them.
"""

import io
import json
import os
import pickle
import shutil
import zipfile
from functools import cache

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.parameters import mostly_slow
from tests.training.tiny import TINY
from windwrench.controllers.features import Features, History
from windwrench.controllers.trained_policy import TrainedPolicy, load_policy
from windwrench.dynamics import InputError
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.envs.scenarios import SCENARIOS
from windwrench.envs.vector import TaskVectorEnv
from windwrench.envs.wind_tasks import WindHoverEnv
from windwrench.evaluation.rewards import WeightedTerms
from windwrench.training.configuration import ALGORITHMS, load_config

pytest.importorskip("torch", reason="pip install 'windwrench[rl]'")
pytest.importorskip("stable_baselines3", reason="pip install 'windwrench[rl]'")
import stable_baselines3 as sb3
import torch

from windwrench.training.checkpoint import load_checkpoint
from windwrench.training.configuration import features_of
from windwrench.training.learners import make_learner, weights_of
from windwrench.training.run import card_of, read_progress
from windwrench.training.train import train
from windwrench.training.training_envs import MixedFanTracking, make_training_envs
from windwrench.training.vec_env import FeatureVecEnv

LEARNERS = ["sac", "td3", "ppo", "recurrent-ppo"]
_ROLLOUTS = ["learner.n_steps=30", "learner.batch_size=20", "learner.n_epochs=2"]
_ON_POLICY = [one for one in TINY if not one.startswith("learner.")] + _ROLLOUTS
SETTINGS = {"ppo": _ON_POLICY, "recurrent-ppo": [*_ON_POLICY, "lstm=4"]}


def tiny(algorithm, *more):
    if algorithm == "recurrent-ppo":
        pytest.importorskip("sb3_contrib", reason="pip install 'windwrench[rl]'")
    return load_config(algorithm, [*SETTINGS.get(algorithm, TINY), *more])


def make_env(config, seed=0):
    return FeatureVecEnv(
        make_training_envs("base", config["environments"]),
        features_of(config),
        lambda i, e: seed + 10 * i + e,
    )


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """The folder of a run of an algorithm, each run once."""

    @cache
    def run(algorithm):
        return train(tiny(algorithm), "base", 3, tmp_path_factory.mktemp(algorithm)).parent

    return run


@pytest.mark.parametrize("algorithm", mostly_slow(LEARNERS, {"sac", "recurrent-ppo"}.__contains__))
def test_a_run_that_stopped_goes_on_as_if_it_had_not(algorithm, trained, tmp_path):
    config = tiny(algorithm)
    train(config, "base", 3, tmp_path, stop_after=180)  # in the middle of an episode
    train(config, "base", 3, tmp_path)
    for name in ("best.npz", "last.npz", "best.json", "last.json"):
        assert (trained(algorithm) / name).read_bytes() == (tmp_path / name).read_bytes()
    a = read_progress(trained(algorithm))
    b = read_progress(tmp_path)
    assert (a.steps, a.rmse_m) == (b.steps, b.rmse_m) == ([120, 240], b.rmse_m)


@pytest.mark.parametrize("algorithm", LEARNERS)
def test_the_shipped_policy_does_what_the_learner_would(algorithm):
    config = tiny(algorithm)
    learner = make_learner(config, make_env(config), 0)
    learner.learn(60)
    policy = TrainedPolicy(card_of(config, "base", 0, 120), weights_of(learner, algorithm))
    policy.reset()
    rng = default_rng(0)
    state = None
    for _ in range(5):
        x = rng.normal(size=features_of(config).size).astype(np.float32)
        expected, state = learner.predict(
            x[None], state=state, episode_start=np.array([state is None]), deterministic=True
        )
        assert_allclose(policy.act(x), expected[0], atol=1e-5)


def test_a_run_says_beside_the_policy_what_it_was_and_another_is_refused(trained):
    folder = trained("sac")
    other = tiny("sac", "net=[9]")
    env = make_env(other)
    with pytest.raises(InputError, match="not a checkpoint of this configuration"):
        load_checkpoint(make_learner(other, env, 0), env, folder / "checkpoint.pt")
    for config, scenario in ((tiny("sac", "learner.gamma=0.9"), "base"), (tiny("sac"), "fast")):
        with pytest.raises(InputError, match="another configuration, scenario or seed"):
            train(config, scenario, 3, folder)
    card = load_policy(folder / "best.npz").card
    assert (card["algorithm"], card["scenario"], card["seed"]) == ("sac", "base", 3)
    assert card["config"] == tiny("sac") != load_config("sac")
    assert card["versions"]["stable-baselines3"] == sb3.__version__
    assert card["seeds"]["training"][1] < card["seeds"]["validation"][0]
    kept = json.loads((folder / "training.json").read_bytes())
    assert kept["config"] == card["config"]
    assert any((folder / "tensorboard").iterdir()) or (folder / "progress.csv").exists()


def test_every_key_can_be_overridden_and_no_other():
    for algorithm in ALGORITHMS:
        config = load_config(algorithm)
        for key, value in config.items():
            inner = value if isinstance(value, dict) else {"": value}
            for name, old in inner.items() if key != "algorithm" else ():
                text = f"{key}.{name}".rstrip(".")
                assert load_config(algorithm, [f"{text}={json.dumps(old)}"]) == config


def test_a_configuration_file_comes_before_single_settings(tmp_path):
    (tmp_path / "mine.yaml").write_text(
        "learner: {gamma: 0.9, tau: 0.02}\nsteps: 99\n", encoding="utf-8"
    )
    config = load_config("sac", ["learner.gamma=0.8"], tmp_path / "mine.yaml")
    learner = config["learner"]
    assert (learner["gamma"], learner["tau"], config["steps"]) == (0.8, 0.02, 99)


@pytest.mark.parametrize(
    "starts", [[0, 1, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0, 1, 0, 0, 0], [1, 0, 0, 0, 0, 0, 1, 0]]
)
def test_sequences_in_one_call_are_those_of_sb3_contrib(starts):
    """One sequence or two, with an episode's start at the first step, at none, or in the middle."""
    from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy

    from windwrench.training.fast_lstm import FastLstmPolicy

    torch.manual_seed(0)
    lstm = torch.nn.LSTM(3, 5)
    count = len(starts) // 4
    states = torch.randn(1, count, 5), torch.randn(1, count, 5)
    given = torch.randn(len(starts), 3), states, torch.tensor(starts, dtype=torch.float32), lstm
    ours, then = FastLstmPolicy._process_sequence(*given)
    theirs, expected = RecurrentActorCriticPolicy._process_sequence(*given)
    torch.testing.assert_close(ours, theirs)
    torch.testing.assert_close(then, expected)


SHORT = [*TINY, "steps=120", "learner.learning_starts=20", "learner.buffer_size=500"]
NAMES = ("checkpoint.pt", "training.json")


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stopped") / "run"
    train(load_config("sac", SHORT), "base", 0, folder, stop_after=60)
    assert not (folder / "best.npz").exists()
    return folder


def packed(data):
    """Return an archive with the same members, packed."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w", 8) as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
    return out.getvalue()


def with_state(change):
    """Return what spoils a checkpoint by changing what it holds."""

    def spoil(data):
        state = torch.load(io.BytesIO(data), weights_only=True)
        out = io.BytesIO()
        torch.save(change(state), out)
        return out.getvalue()

    return spoil


def with_text(**changes):
    return with_state(
        lambda state: {**state, "text": json.dumps({**json.loads(state["text"]), **changes})}
    )


SPOILED = {
    "empty": lambda data: b"",
    "cut in the middle": lambda data: data[: len(data) // 2],
    "a pickle": lambda data: pickle.dumps({"parameters": 1}),
    "deep": lambda data: b"[" * 100_000,
}
CHECKPOINTS = {
    "packed": packed,
    "no mapping": with_state(lambda state: [1, 2]),
    "lacks an entry": with_state(
        lambda state: {name: value for name, value in state.items() if name != "counters"}
    ),
    "a text for tensors": with_state(lambda state: {**state, "replay": "none"}),
    "a tensor of no memory": with_state(
        lambda state: {**state, "numpy": torch.zeros(1, dtype=torch.int64).expand(10**9)}
    ),
    "episodes of other environments": with_text(episode=[0, 0, 0]),
    "progress of another kind": with_text(extra={"steps": 3}),
    "progress that is a list": with_text(extra=[1]),
    "no generator": with_text(numpy=["MT19937"]),
    "counters of another kind": with_state(lambda state: {**state, "counters": 5}),
}
CASES = [(name, how) for name in NAMES for how in SPOILED] + [
    ("checkpoint.pt", how) for how in CHECKPOINTS
]


@pytest.mark.parametrize(("name", "how"), CASES, ids=[f"{n}, {h}" for n, h in CASES])
def test_a_spoiled_file_is_named_in_one_line(name, how, stopped, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(stopped, folder)
    path = folder / name
    path.write_bytes((SPOILED | CHECKPOINTS)[how](path.read_bytes()))
    with pytest.raises(InputError) as refused:
        train(load_config("sac", SHORT), "base", 0, folder)
    message = str(refused.value)
    assert message.startswith((f"{path}: ", f"{folder}: "))
    assert len(message) < 700
    assert "\n" not in message


@pytest.mark.parametrize("name", NAMES)
def test_a_pipe_in_its_place_is_refused_at_once(name, stopped, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(stopped, folder)
    (folder / name).unlink()
    os.mkfifo(folder / name)
    with pytest.raises(InputError, match=f"{name}: is a pipe"):
        train(load_config("sac", SHORT), "base", 0, folder)


@pytest.mark.parametrize("text", ["", "[]", "7", '{"steps": 1}', '{"steps": ["a"]}', '{"x": 1}'])
def test_progress_of_another_kind_is_refused(text, tmp_path):
    (tmp_path / "progress.json").write_text(text)
    with pytest.raises(InputError, match=r"progress\.json: "):
        read_progress(tmp_path)


FEATURES = Features(("torque_z", "force_x", "velocity_y", "command"), 3)


def seed_of(environment, episode):
    return 100 * environment + episode


def make(count, limit, *reward):
    envs = TaskVectorEnv(count, limit, task=FanTrackingEnv, scenario="static")
    return FeatureVecEnv(envs, FEATURES, seed_of, *reward)


def away(seed):
    """The direction in which the vehicle stands off the axis."""
    _, info = FanTrackingEnv("static").reset(seed=seed)
    return float(np.sign(info["offset"]))


def lone_flight(seed, commands):
    """Features and rewards of a single environment, computed by itself."""
    env = FanTrackingEnv("static")
    history = History(FEATURES, 1)
    observation, _ = env.reset(seed=seed)
    history.restart(FEATURES.frames(observation[None]))
    seen = [history.flat()[0]]
    rewards = []
    for command in commands:
        observation, reward, lost, *_ = env.step(np.array([command], dtype=np.float32))
        history.push(FEATURES.frames(observation[None]))
        seen.append(history.flat()[0])
        rewards.append(reward)
        if lost:
            break
    return np.array(seen), np.array(rewards)


def test_each_environment_ends_by_itself_with_its_own_last_observation():
    """The first runs out of time and the second is lost; their next episodes begin at once."""
    limit = 30
    env = make(2, limit)
    direction = away(seed_of(1, 0))
    flights = [lone_flight(seed_of(i, 0), [c] * limit)[0] for i, c in enumerate((0.0, direction))]
    ends = [len(seen) - 1 for seen in flights]
    assert 5 < ends[1] < ends[0] == limit
    env.reset()
    for k in range(1, limit + 1):
        command = direction if k <= ends[1] else 0.0
        seen, _, dones, infos = env.step(np.array([[0.0], [command]]))
        assert dones.tolist() == [k == end for end in ends]
        assert ["terminal_observation" in info for info in infos] == dones.tolist()
        for i, (alone, end) in enumerate(zip(flights, ends, strict=True)):
            if k < end:
                assert_array_equal(seen[i], alone[k])
            if k == end:
                assert_array_equal(infos[i]["terminal_observation"], alone[-1])
                assert infos[i]["TimeLimit.truncated"] is (i == 0)
                assert infos[i]["episode"]["l"] == end
                assert_array_equal(seen[i], lone_flight(seed_of(i, 1), [])[0][0])


def test_a_vehicle_lost_at_the_last_moment_was_lost_not_out_of_time():
    direction = away(seed_of(0, 0))
    gone = len(lone_flight(seed_of(0, 0), [direction] * 60)[0]) - 1
    env = make(1, gone)
    env.reset()
    for _ in range(gone):
        _, _, dones, infos = env.step(np.array([[direction]]))
    assert dones[0]
    assert infos[0]["TimeLimit.truncated"] is False


def test_rewards_are_weighted_terms():
    commands = [0.5, -0.5, 0.2]
    _, rewards = lone_flight(seed_of(0, 0), commands)
    env = make(1, 50)
    env.reset()
    assert_allclose([env.step(np.array([[c]]))[1][0] for c in commands], rewards, rtol=1e-6)
    squared = make(1, 50, WeightedTerms({"tracking": 0.0, "change": 0.0, "squared": 1.0}))
    squared.reset()
    assert squared.step(np.array([[0.0]]))[1][0] == pytest.approx(-0.64, abs=0.1)  # about 0.8 m off


class Rates(WindHoverEnv):
    vehicle = "crazyflie"
    action = "rates"
    observation = "pose"


def test_vehicle_action_and_observation_of_a_class_hold_and_sb3_trains_on_its_lanes():
    env = FeatureVecEnv(Rates.vector(8, plant="lanes"))
    shapes = env.observation_space.shape, env.action_space.shape
    assert (env.envs.task.vehicle.name, *shapes) == ("crazyflie", (16,), (4,))
    assert sb3.PPO("MlpPolicy", env, n_steps=8, batch_size=16).learn(64).num_timesteps == 64


def test_the_scenario_of_a_mixed_episode_says_nothing_of_its_motion():
    env = MixedFanTracking(("base", "fast"), estimator="constant-gain")
    moved = {"base": set(), "fast": set()}
    for seed in range(60):
        _, info = env.reset(seed=seed)
        moved["base" if env.scenario is SCENARIOS["base"] else "fast"].add(info["fan_motion"])
    assert moved == {
        "base": {"sine", "triangle", "ramp", "still"},
        "fast": {"sine", "triangle", "ramp"},
    }
