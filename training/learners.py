"""The learners of stable-baselines3, made from a configuration, and their results as a policy's
weights.
"""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import VecEnv

from ..controllers.trained_policy import Weights
from .configuration import Config

ACTIVATIONS = {"relu": torch.nn.ReLU, "tanh": torch.nn.Tanh}


def make_learner(config: Config, env: VecEnv, seed: int) -> Any:
    """Return the SB3 learner of a configuration."""
    torch.set_num_threads(1)  # the networks are small: threads would only wait for each other
    algorithm = config["algorithm"]
    policy: dict[str, Any] = {
        "net_arch": config["net"],
        "activation_fn": ACTIVATIONS[config["activation"]],
        "optimizer_kwargs": {"fused": True},
    }
    start = config["learner"]["learning_rate"]
    end = config["learning_rate_end"]
    learner: Any = None

    def rate(_: float) -> float:
        """Fall in a straight line over the run; SB3's own share of the run begins anew with every
        call of ``learn``.
        """
        done = 0 if learner is None else learner.num_timesteps
        return float(start + (end - start) * min(done / config["steps"], 1.0))

    arguments: dict[str, Any] = {
        **config["learner"],
        "learning_rate": rate,
        "seed": seed,
        "device": "cpu",
        "verbose": 0,
    }
    kind: Any = {"sac": SAC, "td3": TD3, "ppo": PPO}.get(algorithm)
    network: Any = "MlpPolicy"
    if algorithm == "td3":
        size = env.action_space.shape
        arguments["action_noise"] = NormalActionNoise(
            np.zeros(size), np.full(size, config["noise"])
        )
    elif algorithm == "recurrent-ppo":
        from sb3_contrib import RecurrentPPO

        from .fast_lstm import FastLstmPolicy

        kind = RecurrentPPO
        network = FastLstmPolicy
        policy["lstm_hidden_size"] = config["lstm"]
    if algorithm in ("ppo", "recurrent-ppo"):
        policy["log_std_init"] = config["log_std_init"]
        policy["net_arch"] = {"pi": config["net"], "vf": config["net"]}
    learner = kind(network, env, policy_kwargs=policy, **arguments)
    return learner


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
            arrays = cell_weights("lstm", policy.lstm_actor)
    return arrays | dense_weights(layers)


def dense_layers(sizes: Sequence[int], activation: str) -> torch.nn.Sequential:
    """Return linear layers between these sizes, with an activation after each but the last."""
    layers: list[torch.nn.Module] = []
    for inner, outer in itertools.pairwise(sizes):
        layers += [torch.nn.Linear(inner, outer), ACTIVATIONS[activation]()]
    return torch.nn.Sequential(*layers[:-1])


def cell_weights(name: str, cell: Any) -> Weights:
    """Return the weights of a recurrent cell, ``lstm`` or ``gru``, by a policy's names."""
    return {
        f"{name}_input": array_of(cell.weight_ih_l0),
        f"{name}_hidden": array_of(cell.weight_hh_l0),
        f"{name}_input_bias": array_of(cell.bias_ih_l0),
        f"{name}_hidden_bias": array_of(cell.bias_hh_l0),
    }


def dense_weights(layers: Any) -> Weights:
    """Return ``weight0, bias0, ...`` of the linear layers among ``layers``."""
    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    arrays: Weights = {}
    for i, layer in enumerate(linear):
        arrays[f"weight{i}"], arrays[f"bias{i}"] = array_of(layer.weight), array_of(layer.bias)
    return arrays


def array_of(tensor: torch.Tensor) -> Any:
    """Return a copy of a tensor's numbers."""
    return tensor.detach().numpy().copy()
