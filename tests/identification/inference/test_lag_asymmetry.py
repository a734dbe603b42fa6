"""Rotors that speed up sooner than they slow down: no mass is missing for that."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.searches import VEHICLE, recorded, searched
from windwrench.identification.motion.smoothing import low_pass

TAU, APART = 0.03, 0.008  # s: 22 ms up, 38 ms down
EFFECTS = {"motor_lag": {"tau": TAU}, "mass": {"dm": 0.0}}


def flown(commanded):
    """A flight, and its log with the commands that such a lag turns into its rotor speeds."""
    log = recorded(seed=3)
    speeds = low_pass(log.rotor_speeds, 12.0, log.period)
    rate = np.gradient(speeds, log.period, axis=0)
    tau = np.where(rate > 0.0, TAU - APART, TAU + APART)
    return replace(log, rotor_speeds=speeds + tau * rate if commanded else speeds)


def fitted(log, *effects):
    return searched(log, ["motor_lag", "mass"], **{name: EFFECTS[name] for name in effects})


def test_a_lag_that_is_uneven_leaves_no_mass():
    """The mass is that of a fit to the rotor speeds themselves, which are smoothed here."""
    _, known = fitted(flown(commanded=False), "mass")
    search, fit = fitted(flown(commanded=True), "mass", "motor_lag")
    assert fit.setting[""]["lag_asymmetry"] == pytest.approx(APART, abs=0.003)
    assert fit.setting["motor_lag"]["tau"] == pytest.approx(TAU, abs=0.003)
    off = fit.setting["mass"]["dm"] - known.setting["mass"]["dm"]
    assert abs(off) < 0.001 * VEHICLE.mass
    # a lag that goes takes its asymmetry with it
    assert "lag_asymmetry" not in search.refit(fit.without("motor_lag")).setting.get("", {})
