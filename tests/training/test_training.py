"""Training: configurations, the update, exact resumption, and policies that fly as the learner
would.
"""

import json

import gymnasium as gym
import numpy as np
import pytest

from tests.training.tiny import TINY
from windwrench.controllers.trained_policy import TrainedPolicy, load_policy
from windwrench.dynamics import InputError
from windwrench.training.configuration import ALGORITHMS, load_config

pytest.importorskip("torch", reason="pip install 'windwrench[rl]'")
pytest.importorskip("stable_baselines3", reason="pip install 'windwrench[rl]'")
import stable_baselines3 as sb3
import torch
from stable_baselines3.common.vec_env import DummyVecEnv

from windwrench.training.checkpoint import load_checkpoint
from windwrench.training.configuration import features_of
from windwrench.training.learners import make_learner, weights_of
from windwrench.training.run import card_of, read_progress
from windwrench.training.train import train
from windwrench.training.training_envs import make_training_envs
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


@pytest.mark.parametrize("algorithm", LEARNERS)
def test_a_run_that_stopped_goes_on_as_if_it_had_not(algorithm, tmp_path):
    config = tiny(algorithm)
    train(config, "base", 3, tmp_path / "whole")
    train(config, "base", 3, tmp_path / "parts", stop_after=60)
    assert not (tmp_path / "parts" / "best.npz").exists()
    train(config, "base", 3, tmp_path / "parts", stop_after=180)  # in the middle of an episode
    train(config, "base", 3, tmp_path / "parts")
    for name in ("best.npz", "last.npz", "best.json", "last.json"):
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "parts" / name).read_bytes()
    a, b = read_progress(tmp_path / "whole"), read_progress(tmp_path / "parts")
    assert (a.steps, a.rmse_m) == (b.steps, b.rmse_m) == ([120, 240], b.rmse_m)


@pytest.mark.parametrize("algorithm", LEARNERS)
def test_the_shipped_policy_does_what_the_learner_would(algorithm):
    config = tiny(algorithm)
    env = make_env(config)
    learner = make_learner(config, env, 0)
    learner.learn(120)
    policy = TrainedPolicy(card_of(config, "base", 0, 120), weights_of(learner, algorithm))
    policy.reset()
    rng, state = np.random.default_rng(0), None
    for _ in range(5):
        x = rng.normal(size=features_of(config).size).astype(np.float32)
        expected, state = learner.predict(
            x[None], state=state, episode_start=np.array([state is None]), deterministic=True
        )
        np.testing.assert_allclose(policy.act(x), expected[0], atol=1e-5)


def wind_env(config):
    """An environment with three actions."""
    return DummyVecEnv([lambda: gym.make("windwrench/WindHover-v1")])


@pytest.mark.parametrize("make_env", [make_env, wind_env])
def test_the_fast_update_is_that_of_stable_baselines3(make_env):
    config = tiny("sac", "learning_rate_end=0.0008")
    learned = []
    for kind in (sb3.SAC, None):
        env = make_env(config)
        learner = make_learner(config, env, 0)
        if kind is not None:
            learner = kind(
                "MlpPolicy",
                make_env(config),
                seed=0,
                device="cpu",
                policy_kwargs={"net_arch": config["net"]},
                **{**config["learner"], "learning_rate": 0.0008},
            )
        learner.learn(60)  # the first updates too
        torch.manual_seed(1)
        np.random.seed(1)  # noqa: NPY002
        learner.train(20, 64)
        learned.append(
            {**learner.policy.state_dict(), "log_ent_coef": learner.log_ent_coef.detach()}
        )
    for name, value in learned[0].items():
        np.testing.assert_allclose(value.numpy(), learned[1][name].numpy(), atol=2e-5, err_msg=name)
    fresh = make_learner(config, make_env(config), 0).policy.state_dict()
    assert (
        float((fresh["actor.mu.weight"] - learned[0]["actor.mu.weight"]).abs().max()) > 1e-3
    )  # something was learned


def test_a_run_says_beside_the_policy_what_it_was_and_another_is_refused(tmp_path):
    path = train(tiny("sac", "learner.gamma=0.9"), "base", 2, tmp_path)
    other = tiny("sac", "net=[9]")
    env = make_env(other)
    with pytest.raises(InputError, match="not a checkpoint of this configuration"):
        load_checkpoint(make_learner(other, env, 0), env, tmp_path / "checkpoint.pt")
    for config, scenario in ((tiny("sac"), "base"), (tiny("sac", "learner.gamma=0.9"), "fast")):
        with pytest.raises(InputError, match="another configuration, scenario or seed"):
            train(config, scenario, 2, tmp_path)
    card = load_policy(path).card
    assert (card["algorithm"], card["scenario"], card["seed"]) == ("sac", "base", 2)
    assert card["config"]["learner"]["gamma"] == 0.9
    assert card["versions"]["stable-baselines3"] == sb3.__version__
    assert card["seeds"]["training"][1] < card["seeds"]["validation"][0]
    kept = json.loads((tmp_path / "training.json").read_text())
    assert kept["config"] == card["config"]
    assert any((tmp_path / "tensorboard").iterdir()) or (tmp_path / "progress.csv").exists()


def test_imitation_learns_the_oracle_s_commands(tmp_path):
    short = ["steps=3000", "rounds=3", "epochs=15", "net=[32]"]
    short += ["validation.every=1000", "validation.episodes=3"]
    config = load_config("imitation", short)
    train(config, "base", 0, tmp_path)
    progress = read_progress(tmp_path)
    assert progress.steps[-1] >= 3000
    assert progress.best_rmse < 0.35
    before = (tmp_path / "best.npz").read_bytes()
    train(config, "base", 0, tmp_path)  # done already
    assert (tmp_path / "best.npz").read_bytes() == before


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
    lstm, count = torch.nn.LSTM(3, 5), len(starts) // 4
    states = torch.randn(1, count, 5), torch.randn(1, count, 5)
    given = torch.randn(len(starts), 3), states, torch.tensor(starts, dtype=torch.float32), lstm
    ours, then = FastLstmPolicy._process_sequence(*given)
    theirs, expected = RecurrentActorCriticPolicy._process_sequence(*given)
    torch.testing.assert_close(ours, theirs)
    torch.testing.assert_close(then, expected)
