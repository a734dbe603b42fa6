"""Soft actor-critic with the update of stable-baselines3 in far fewer calls.

Networks as small as these spend most of an update between operations, not in them. The two critics
are computed side by side as one batch of matrices. Gradients are taken of changed weights alone,
and optimiser and target network take one call each. The arithmetic is
``stable_baselines3.SAC.train``'s, with random numbers in the same order: a test holds one to the
other.
"""

import math
from typing import Any

import numpy as np
import torch
from stable_baselines3 import SAC

_HALF_LOG_TWO_PI = 0.5 * math.log(2.0 * math.pi)
_SMALLEST = 1e-6  # keeps the logarithm of the squashing's derivative finite


class FastSAC(SAC):  # type: ignore[misc]
    """``SAC`` for small fully connected networks with ReLU and two critics."""

    def _setup_model(self) -> None:
        super()._setup_model()
        self._weights, self._biases = _stack(self.critic)
        self._target_weights, self._target_biases = _stack(self.critic_target)
        self._critic_parameters = [*self._weights, *self._biases]
        self._target_parameters = [*self._target_weights, *self._target_biases]
        self._actor_parameters = list(self.actor.parameters())
        self._hidden = [
            layer for layer in self.actor.latent_pi if isinstance(layer, torch.nn.Linear)
        ]
        for parameter in self._critic_parameters:
            parameter.requires_grad_()
        rate = self.lr_schedule(1)
        self.critic.optimizer = torch.optim.Adam(self._critic_parameters, lr=rate, fused=True)
        self.actor.optimizer = torch.optim.Adam(self._actor_parameters, lr=rate, fused=True)

    def _act(self, observations: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Draw actions (n, k) and return them with the logarithm of their probability (n, 1)."""
        x = observations
        for layer in self._hidden:
            x = torch.relu(torch.nn.functional.linear(x, layer.weight, layer.bias))
        mean = torch.nn.functional.linear(x, self.actor.mu.weight, self.actor.mu.bias)
        log_std = torch.nn.functional.linear(
            x, self.actor.log_std.weight, self.actor.log_std.bias
        ).clamp(-20, 2)
        noise = torch.normal(torch.zeros_like(mean), torch.ones_like(mean))
        action = torch.tanh(torch.addcmul(mean, noise, log_std.exp()))
        log_prob = (
            -0.5 * noise.square()
            - log_std
            - _HALF_LOG_TWO_PI
            - torch.log(1.0 - action.square() + _SMALLEST)
        )
        return action, log_prob.sum(dim=1, keepdim=True)

    def train(self, gradient_steps: int, batch_size: int = 64) -> None:
        """Do ``gradient_steps`` updates."""
        self.policy.set_training_mode(True)
        optimizers = [self.actor.optimizer, self.critic.optimizer]
        if self.ent_coef_optimizer is not None:
            optimizers.append(self.ent_coef_optimizer)
        self._update_learning_rate(optimizers)
        losses = np.zeros((gradient_steps, 3))
        for k in range(gradient_steps):
            data = self.replay_buffer.sample(batch_size, env=self._vec_normalize_env)
            actions, log_prob = self._act(data.observations)
            if self.ent_coef_optimizer is not None:
                coefficient = float(self.log_ent_coef.detach().exp())
                # the derivative of -(log_ent_coef * (log_prob + target_entropy)).mean()
                self.log_ent_coef.grad = -(log_prob.detach().mean() + self.target_entropy).reshape(
                    1
                )
                self.ent_coef_optimizer.step()
            else:
                coefficient = float(self.ent_coef_tensor)
            with torch.no_grad():
                later, later_log_prob = self._act(data.next_observations)
                inputs = torch.cat([data.next_observations, later], dim=1)
                value = (
                    _critics(self._target_weights, self._target_biases, inputs).amin(dim=0)
                    - coefficient * later_log_prob
                )
                target = data.rewards + (1.0 - data.dones) * self.gamma * value
            inputs = torch.cat([data.observations, data.actions], dim=1)
            critic_loss = (
                _critics(self._weights, self._biases, inputs) - target
            ).square().sum() * (0.5 / batch_size)
            _descend(critic_loss, self._critic_parameters, self.critic.optimizer)
            inputs = torch.cat([data.observations, actions], dim=1)
            actor_loss = (
                coefficient * log_prob - _critics(self._weights, self._biases, inputs).amin(dim=0)
            ).mean()
            _descend(actor_loss, self._actor_parameters, self.actor.optimizer)
            if k % self.target_update_interval == 0:
                with torch.no_grad():
                    torch._foreach_lerp_(self._target_parameters, self._critic_parameters, self.tau)
            losses[k] = coefficient, actor_loss.item(), critic_loss.item()
        self._n_updates += gradient_steps
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")
        for name, value in zip(
            ("ent_coef", "actor_loss", "critic_loss"), losses.mean(axis=0), strict=True
        ):
            self.logger.record(f"train/{name}", value)


def _stack(critic: Any) -> tuple[list[torch.Tensor], list[torch.Tensor]]:
    """Return weights (2, in, out) and biases (2, 1, out) of both critics, layer by layer; from now
    on they share the critics' memory.
    """
    layers = [[m for m in net if isinstance(m, torch.nn.Linear)] for net in critic.q_networks]
    weights, biases = [], []
    for pair in zip(*layers, strict=True):
        weight = torch.stack([m.weight.data.T for m in pair]).contiguous()
        bias = torch.stack([m.bias.data[None] for m in pair])
        for m, w, b in zip(pair, weight, bias, strict=True):
            m.weight.data, m.bias.data = w.T, b[0]
        weights.append(weight)
        biases.append(bias)
    return weights, biases


def _critics(
    weights: list[torch.Tensor], biases: list[torch.Tensor], inputs: torch.Tensor
) -> torch.Tensor:
    """Return both critics' values (2, n, 1) of observations and actions (n, in)."""
    x = inputs.expand(len(weights[0]), -1, -1)
    for i, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        x = torch.baddbmm(bias, x, weight)
        if i + 1 < len(weights):
            x = torch.relu(x)
    return x


def _descend(
    loss: torch.Tensor, parameters: list[torch.Tensor], optimizer: torch.optim.Optimizer
) -> None:
    for parameter, gradient in zip(parameters, torch.autograd.grad(loss, parameters), strict=True):
        parameter.grad = gradient
    optimizer.step()
