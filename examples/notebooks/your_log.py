# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # Your own log: what does the model lack?
#
# You have a log (time, pose, rotor speeds) and a vehicle file. `diagnose` names the physical effect
# that the model lacks, with its coefficients, and compares the prediction errors before and after.
#
# This log is simulated, with a known truth: the vehicle has rotor drag, the model has none. Put
# your own log in place of `flight.csv`, and your vehicle's YAML file in place of `ardrone2`.

# %%

import matplotlib.pyplot as plt
import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.envs.recording import record_flight
from windwrench.identification import diagnose, read_log
from windwrench.identification.logs.flight_log import FlightLog, write_log
from windwrench.runtime.drawing import AFTER, BEFORE, HELD_OUT

# %%
vehicle = load_vehicle("ardrone2")
drag = EffectSetting("rotor_drag", {"kdx": 1.2e-4, "kdy": 1.2e-4})
flown = record_flight(vehicle, (drag,), "excite", seconds=20.0, seed=1)
write_log(
    FlightLog(flown["t"], flown["position"], flown["quaternion"], flown["rotor_speeds"]),
    "flight.csv",
)

# %% [markdown]
# ## The diagnosis
#
# No fit uses every fourth block of 3 s. Errors before and after are those of these blocks.

# %%
diagnosis = diagnose([read_log("flight.csv", vehicle=vehicle)], vehicle)
print(diagnosis.verdict)
for effect in diagnosis.effects:
    for name, value in effect.coefficients.items():
        print(f"{effect.name}: {name} = {value:.3g} ± {effect.std[name]:.1g} {effect.units[name]}")
before, after = diagnosis.before.force_rms, diagnosis.after.force_rms
print(f"force error {before:.3f} N before, {after:.3f} N after")

# %% [markdown]
# ## Before and after
#
# The residual is the force that the measured motion needs beyond the model's.

# %%
trace = diagnosis.traces[0]
names = ", ".join(effect.name for effect in diagnosis.effects) or "nothing"
figure, axes = plt.subplots(2, 1, figsize=(7, 4.2), sharex=True, layout="constrained")
for ax, channel, label in zip(axes, (0, 1), "xy", strict=True):
    ax.plot(trace.t, trace.before[:, channel], color=BEFORE, lw=1.2, label="before")
    ax.plot(trace.t, trace.after[:, channel], color=AFTER, lw=1.2, label="after")
    ax.fill_between(
        trace.t,
        *ax.get_ylim(),
        where=np.asarray(trace.held_out, dtype=bool),
        color=HELD_OUT,
        label="held out",
        zorder=0,
    )
    ax.set_ylabel(f"residual force {label} (N)")
axes[0].set_title(
    f"The model lacked {names}: force error {diagnosis.before.force_rms:.2f} → "
    f"{diagnosis.after.force_rms:.2f} N (noise floor {diagnosis.floor_force_rms:.2f} N)"
)
figure.legend(*axes[0].get_legend_handles_labels(), ncols=3, loc="outside lower center")
axes[1].set_xlabel("time (s)")
figure.savefig("your_log.png", dpi=110)

# %% [markdown]
# `windwrench diagnose flight.csv --vehicle ardrone2` does the same, and writes `report.html`. Next:
# [Diagnose your own drone](../../docs/tutorials/diagnose.md), [Your log in ten
# minutes](../../docs/tutorials/your-log.md).
