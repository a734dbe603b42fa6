# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # The environment: hold the vehicle in a jet that it cannot see
#
# A fan moves from side to side. The vehicle must stay in front of it. It sees neither the fan nor
# its own position: the observation is the external force and torque that the filter estimates.

# %%
import gymnasium as gym
import matplotlib.pyplot as plt

import windwrench  # noqa: F401  # registers the environments
from windwrench.runtime.drawing import GREY, SERIES

env = gym.make("windwrench/FanTracking-v1", scenario="base", normalize=False)
print(env.observation_space, env.action_space)

# %% [markdown]
# ## Two controllers
#
# Off the axis the jet turns the vehicle, because its drag is larger on one side: the sign of the
# torque about the vertical says where the axis is. The law of the paper commands a velocity in
# proportion to it.


# %%
def hover(observation):
    """Command nothing."""
    return [0.0]


def admittance(observation):
    """Command -18 m/s for each Nm of estimated torque about the vertical."""
    return [-18.0 * observation[5]]


# %% [markdown]
# ## The same episode for both
#
# A seed is an episode: the same path of the fan, the same turbulence, the same sensor noise.
# `info["offset"]` is the true distance from the axis; no controller may use it.


# %%
def fly(controller, seed=4):
    """Return the offset in m at each decision of an episode."""
    observation, info = env.reset(seed=seed)
    offsets = [info["offset"]]
    over = False
    while not over:
        observation, _, terminated, truncated, info = env.step(controller(observation))
        offsets.append(info["offset"])
        over = terminated or truncated
    return offsets


flights = {law.__name__: fly(law) for law in (hover, admittance)}
rmse = {name: (sum(x * x for x in y) / len(y)) ** 0.5 for name, y in flights.items()}

# %%
figure, ax = plt.subplots(figsize=(7, 3.2), layout="constrained")
for (name, offsets), colour in zip(flights.items(), (GREY, SERIES[1]), strict=True):
    told = f"{name}: {rmse[name]:.2f} m RMSE"
    ax.plot([k / 12.5 for k in range(len(offsets))], offsets, color=colour, label=told)
    print(f"{name}: {rmse[name]:.3f} m")
ax.set(xlabel="time (s)", ylabel="distance from the axis (m)", title="One episode, two controllers")
ax.legend()
ax.grid(alpha=0.3)
figure.savefig("environment.png", dpi=110)

# %% [markdown]
# One episode ranks nobody: `windwrench benchmark` flies 40 paired ones and gives intervals. Next:
# [Design a controller](../../docs/tutorials/train.md), [Train a
# policy](../../docs/tutorials/train.md).
