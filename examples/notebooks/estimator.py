# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # The estimator: a force that nobody measures
#
# A quadrotor hovers. From 2 s to 5 s a string pulls the vehicle sideways with 0.3 N. No sensor
# measures this force. The filter estimates the force from rotor speeds and pose, which most
# laboratories log.
#
# `estimator.py` runs as a script, too; `python examples/render_notebooks.py` writes
# `estimator.ipynb` from the script.

# %%

import matplotlib.pyplot as plt
import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.estimator import UKFTuning, WrenchUKF
from windwrench.runtime.drawing import SERIES, TRUTH

# %% [markdown]
# ## A flight
#
# `record_flight` flies a vehicle in MuJoCo and returns the columns of its log, with the true
# force. Before each step, `push` returns an external force and torque (N and Nm, world axes).

# %%
vehicle = load_vehicle("ardrone2")


def pull(loop):
    """Return 0.3 N along world y from 2 s to 5 s."""
    return np.array([0.0, 0.3 if 2.0 < loop.time < 5.0 else 0.0, 0.0, 0.0, 0.0, 0.0])


flight = record_flight(vehicle, trajectory="hover", seconds=8.0, seed=1, push=pull)

# %% [markdown]
# ## The filter
#
# One call of `step` takes a measured pose and the rotor speeds since the pose before. `step`
# returns force and torque in world axes, with a covariance. `force_walk` sets how quickly a force
# may change: the default estimate follows in about 1 s.

# %%
tunings = {"default": UKFTuning(), "ten times quicker": UKFTuning(force_walk=3.26e-2)}
estimates = {}
for name, tuning in tunings.items():
    ukf = WrenchUKF(vehicle, tuning, period=0.005)
    ukf.reset(flight["position"][0], flight["quaternion"][0])
    force = []
    for speeds, position, quaternion in zip(
        flight["rotor_speeds"], flight["position"], flight["quaternion"], strict=True
    ):
        force.append(ukf.step(speeds, position, quaternion).force[1])
    estimates[name] = np.array(force)

# %% [markdown]
# ## The estimates
#
# The true force is the pull plus the weak turbulence of every flight. The quick filter follows
# sooner, with more noise.

# %%
settled = (flight["t"] > 3.5) & (flight["t"] < 5.0)
figure, ax = plt.subplots(figsize=(7, 3.2), layout="constrained")
ax.plot(flight["t"], flight["force"][:, 1], color=TRUTH, lw=0.8, label="true force")
print(f"true force: {flight['force'][settled, 1].mean():.2f} N")
for (name, force), colour in zip(estimates.items(), SERIES, strict=False):
    ax.plot(flight["t"], force, color=colour, lw=1.2, label=f"estimate, {name}")
    print(f"{name}: {force[settled].mean():.2f} N")
ax.set(xlabel="time (s)", ylabel="force along y (N)", title="A force from rotor speeds and pose")
ax.legend()
ax.grid(alpha=0.3)
figure.savefig("estimator.png", dpi=110)

# %% [markdown]
# Next: the equations and the tuning are on the page [The estimator](../../docs/estimator.md);
# `windwrench estimate LOG` does this for a log.
