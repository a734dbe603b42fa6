"""The learners of stable-baselines3, made from a configuration, and what they have learned as a
policy's weights.
"""

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.vec_env import VecEnv

from ..controllers.trained_policy import Weights
from .configuration import Config

ACTIVATIONS = {"relu": torch.nn.ReLU, "tanh": torch.nn.Tanh}


def make_learner(config: Config, env: VecEnv, seed: int) -> Any:
    """Return the SB3 algorithm that a configuration describes."""
    torch.set_num_threads(1)  # the networks are small: threads would only wait for each other
    algorithm = config["algorithm"]
    policy: dict[str, Any] = {
        "net_arch": list(config["net"]),
        "activation_fn": ACTIVATIONS[config["activation"]],
        "optimizer_kwargs": {"fused": True},
    }
    start, end = config["learner"]["learning_rate"], config["learning_rate_end"]
    learner: Any = None

    def rate(_: float) -> float:
        """Fall in a straight line over the run; SB3's own share of the run begins anew with every
        call of ``learn``.
        """
        done = 0 if learner is None else learner.num_timesteps
        return float(start + (end - start) * min(done / config["steps"], 1.0))

    given: dict[str, Any] = {
        **config["learner"],
        "learning_rate": rate,
        "seed": seed,
        "device": "cpu",
        "verbose": 0,
    }
    learner = _LEARNERS[algorithm](config, env, policy, given)
    return learner


def _sac(config: Config, env: VecEnv, policy: dict[str, Any], given: dict[str, Any]) -> Any:
    if config["activation"] == "relu":
        from .fast_sac import FastSAC

        return FastSAC("MlpPolicy", env, policy_kwargs=policy, **given)
    from stable_baselines3 import SAC

    return SAC("MlpPolicy", env, policy_kwargs=policy, **given)


def _td3(config: Config, env: VecEnv, policy: dict[str, Any], given: dict[str, Any]) -> Any:
    from stable_baselines3 import TD3
    from stable_baselines3.common.noise import NormalActionNoise

    noise = NormalActionNoise(np.zeros(1), np.full(1, config["noise"]))
    return TD3("MlpPolicy", env, policy_kwargs=policy, action_noise=noise, **given)


def _ppo(config: Config, env: VecEnv, policy: dict[str, Any], given: dict[str, Any]) -> Any:
    from stable_baselines3 import PPO

    return PPO("MlpPolicy", env, policy_kwargs=_actor_critic(config, policy), **given)


def _recurrent_ppo(
    config: Config, env: VecEnv, policy: dict[str, Any], given: dict[str, Any]
) -> Any:
    from sb3_contrib import RecurrentPPO

    from .fast_lstm import FastLstmPolicy

    policy = {**_actor_critic(config, policy), "lstm_hidden_size": config["lstm"]}
    return RecurrentPPO(FastLstmPolicy, env, policy_kwargs=policy, **given)


def _actor_critic(config: Config, policy: dict[str, Any]) -> dict[str, Any]:
    return {
        **policy,
        "log_std_init": config["log_std_init"],
        "net_arch": {"pi": config["net"], "vf": config["net"]},
    }


_LEARNERS = {"sac": _sac, "td3": _td3, "ppo": _ppo, "recurrent-ppo": _recurrent_ppo}


def weights_of(learner: Any, algorithm: str) -> Weights:
    """Return the weights of a learner's deterministic policy, as ``policy.TrainedPolicy`` wants
    them.
    """
    policy = learner.policy
    arrays: Weights = {}
    if algorithm == "sac":
        layers = [*policy.actor.latent_pi, policy.actor.mu]
    elif algorithm == "td3":
        layers = list(policy.actor.mu)
    else:
        layers = [*policy.mlp_extractor.policy_net, policy.action_net]
        if algorithm == "recurrent-ppo":
            cell = policy.lstm_actor
            for name, tensor in (
                ("lstm_input", cell.weight_ih_l0),
                ("lstm_hidden", cell.weight_hh_l0),
                ("lstm_input_bias", cell.bias_ih_l0),
                ("lstm_hidden_bias", cell.bias_hh_l0),
            ):
                arrays[name] = array_of(tensor)
    return arrays | dense_weights(layers)


def dense_weights(layers: Any) -> Weights:
    """Return ``weight0, bias0, ...`` of the linear layers among ``layers``."""
    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    arrays: Weights = {}
    for i, layer in enumerate(linear):
        arrays[f"weight{i}"], arrays[f"bias{i}"] = array_of(layer.weight), array_of(layer.bias)
    return arrays


def array_of(tensor: torch.Tensor) -> Any:
    """Return a copy of a tensor's numbers."""
    return tensor.detach().cpu().numpy().astype(np.float32).copy()


def squashes(algorithm: str) -> bool:
    """Whether an algorithm's policy sends its output through a tanh."""
    return algorithm in ("sac", "td3", "imitation")
