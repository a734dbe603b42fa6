# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # The environment: stay in the jet of a moving fan
#
# A fan moves from side to side, and the vehicle must stay in front of the fan. The observation has
# neither the fan nor the vehicle's position, but the estimated external force and torque.

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
# Off the axis the jet turns the vehicle, because the drag is larger on one side. The sign of the
# yaw torque tells the side of the axis. The paper's law commands a velocity in proportion to the
# yaw torque.


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
# Equal seeds give equal episodes: path of the fan, turbulence and sensor noise. `info["offset"]`
# is the true distance from the axis, for the score alone.


# %%
def fly(controller, seed=4):
    """Return the offset in m at each decision of an episode."""
    observation, info = env.reset(seed=seed)
    offsets = [info["offset"]]
    terminated = truncated = False
    while not (terminated or truncated):
        observation, _, terminated, truncated, info = env.step(controller(observation))
        offsets.append(info["offset"])
    return offsets


flights = {law.__name__: fly(law) for law in (hover, admittance)}
rmse = {name: (sum(x * x for x in y) / len(y)) ** 0.5 for name, y in flights.items()}

# %%
figure, ax = plt.subplots(figsize=(7, 3.2), layout="constrained")
for (name, offsets), colour in zip(flights.items(), (GREY, SERIES[1]), strict=True):
    label = f"{name}: {rmse[name]:.2f} m RMSE"
    ax.plot([k / 12.5 for k in range(len(offsets))], offsets, color=colour, label=label)
    print(f"{name}: {rmse[name]:.3f} m")
ax.set(xlabel="time (s)", ylabel="offset from the axis (m)", title="One episode, two controllers")
ax.legend()
ax.grid(alpha=0.3)
figure.savefig("environment.png", dpi=110)

# %% [markdown]
# One episode is no ranking: `windwrench benchmark` flies 40 paired episodes, with intervals. Next:
# [Design a controller](../../docs/tutorials/train.md), [Train a
# policy](../../docs/tutorials/train.md).
