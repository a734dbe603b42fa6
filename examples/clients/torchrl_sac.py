"""SAC of TorchRL's own parts on the environment: collector, replay buffer, loss.

Install:  pip install torch torchrl windwrench
Run:      python torchrl_sac.py 3000
"""

import sys

import torch
from tensordict.nn import NormalParamExtractor, TensorDictModule
from torch import nn
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import Compose, DoubleToFloat, GymEnv, RewardSum, TransformedEnv
from torchrl.modules import MLP, ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import SACLoss, SoftUpdate

import windwrench  # noqa: F401  (registers the environment)

WARM_UP = 500  # decisions before it learns
FRAMES = 25  # decisions between updates, of which there are as many


def main(steps=3000, seed=0):
    """Train for ``steps`` decisions; return the returns of its episodes."""
    torch.manual_seed(seed)
    env = GymEnv("windwrench/FanTracking-v0", scenario="base", normalize=True)
    env = TransformedEnv(env, Compose(DoubleToFloat(), RewardSum()))
    env.set_seed(seed)
    seen, size = env.observation_spec["observation"].shape[-1], env.action_spec.shape[-1]
    net = nn.Sequential(
        MLP(in_features=seen, out_features=2 * size, num_cells=[64, 64], activation_class=nn.ReLU),
        NormalParamExtractor(),
    )
    actor = ProbabilisticActor(
        TensorDictModule(net, in_keys=["observation"], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        spec=env.action_spec,
        distribution_class=TanhNormal,
        distribution_kwargs={"low": env.action_spec.space.low, "high": env.action_spec.space.high},
        return_log_prob=True,
    )
    critic = ValueOperator(
        MLP(in_features=seen + size, out_features=1, num_cells=[64, 64], activation_class=nn.ReLU),
        in_keys=["action", "observation"],
    )
    loss = SACLoss(actor_network=actor, qvalue_network=critic, num_qvalue_nets=2)
    loss.make_value_estimator(gamma=0.9)
    target = SoftUpdate(loss, tau=0.005)
    optimiser = torch.optim.Adam(loss.parameters(), lr=3e-4)
    memory = TensorDictReplayBuffer(storage=LazyTensorStorage(steps), batch_size=256)
    collector = Collector(
        env, actor, frames_per_batch=FRAMES, total_frames=steps, init_random_frames=WARM_UP
    )
    returns, flown = [], 0
    for batch in collector:
        flown += batch.numel()
        over = batch["next", "done"].reshape(-1)
        returns += batch["next", "episode_reward"].reshape(-1)[over].tolist()
        memory.extend(batch.reshape(-1))
        if flown < WARM_UP:
            continue
        for _ in range(FRAMES):
            found = loss(memory.sample())
            total = found["loss_actor"] + found["loss_qvalue"] + found["loss_alpha"]
            optimiser.zero_grad()
            total.backward()
            optimiser.step()
            target.step()
    collector.shutdown()
    return returns


if __name__ == "__main__":
    from report import report

    wanted = int(sys.argv[1])
    report(
        "TorchRL, SAC",
        ("torchrl", "tensordict", "torch", "gymnasium"),
        wanted,
        lambda: main(wanted),
    )
