"""Rotors that speed up sooner than they slow down: no mass is missing for that."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.flown import VEHICLE, recorded
from windwrench.identification.diagnosis.log_offsets import LAG_ASYMMETRY
from windwrench.identification.diagnosis.ranking import rank
from windwrench.identification.diagnosis.regression import Flights
from windwrench.identification.motion.smoothing import low_pass

TAU, APART = 0.03, 0.008  # s: 22 ms up, 38 ms down


def flown(commanded):
    """A flight, and its log with the commands that such a lag turns into its rotor speeds."""
    log = recorded(seed=3)
    speeds = low_pass(log.rotor_speeds, 12.0, log.period)
    rate = np.gradient(speeds, log.period, axis=0)
    tau = np.where(rate > 0.0, TAU - APART, TAU + APART)
    return replace(log, rotor_speeds=speeds + tau * rate if commanded else speeds)


def test_a_lag_that_is_uneven_leaves_no_mass():
    """The mass is that of a fit to the rotor speeds themselves, which are smoothed here."""
    library = ["motor_lag", "mass"]
    known = rank(Flights([flown(commanded=False)], VEHICLE), library).ranking.sets[0]
    found = rank(Flights([flown(commanded=True)], VEHICLE), library)
    assert found.setting["motor_lag"]["tau"] == pytest.approx(TAU, abs=0.006)
    apart, _ = found.posterior.nuisances()[LAG_ASYMMETRY]
    assert 0.5 * APART < apart < 1.5 * APART
    off = [x.coefficients.get("mass", {"dm": 0.0})["dm"] for x in (found.ranking.sets[0], known)]
    assert abs(off[0] - off[1]) < 0.001 * VEHICLE.mass
