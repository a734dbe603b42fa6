"""The ranking of sets of effects on short flights."""

import math

import numpy as np
import pytest

from tests.support.flown import DRAG, VEHICLE, settings
from windwrench.evidence.trials.practice_flights import fly_practice
from windwrench.identification.diagnosis.column import Column, Part
from windwrench.identification.diagnosis.likelihood import Likelihood
from windwrench.identification.diagnosis.ranking import rank
from windwrench.identification.diagnosis.regression import RegressedFlights
from windwrench.identification.diagnosis.sets import Posterior


def flown(**effects):
    log = fly_practice(VEHICLE, settings(effects), "excite", 12.0, seed=5)
    return RegressedFlights([log], VEHICLE)


def test_a_law_that_the_library_lacks_shows_as_structure():
    assert rank(flown(rotor_drag=DRAG), ("mass", "inertia"), print).ranking.structure > 10.0


def test_a_fit_whose_filter_diverges_starts_nearer_to_the_declared_vehicle(monkeypatch):
    """A measured load on a thread began with a fifth of its inertia, and ended in a traceback."""
    flights = flown(rotor_drag=DRAG)
    unstable = {"rate_damping": {"dx": -0.05, "dy": 0.0, "dz": 0.0}}
    with pytest.raises(np.linalg.LinAlgError, match="diverges"):
        Likelihood(flights, unstable, Likelihood(flights, {}), same_noise=True)
    monkeypatch.setattr(Posterior, "best_setting", lambda *_: unstable)
    begun = rank(flights, ("rate_damping",), print).ranking.sets[0]
    assert begun.effects in ((), ("rate_damping",))


def test_equal_offsets_of_mass_and_marker_are_told_by_the_thrust_alone():
    """Both at one place: the measured point is the centre of mass again, and nothing but the
    thrust's arm is left; along z it has none.
    """
    base = Likelihood(flown(), {}).base(("com_offset", "marker_offset"), {})
    at = base.at([Column("com_offset", "cz"), Column("marker_offset", "mz")])
    (a, b), (_, d) = base.total[np.ix_(at, at)] / np.outer(base.size[at], base.size[at])
    assert a + 2.0 * b + d < 1e-5 * (a - 2.0 * b + d)


def test_the_gain_of_a_torque_is_known_where_rotors_leave_their_rounding():
    sizes = {}
    for trajectory in ("hover", "excite"):
        log = fly_practice(VEHICLE, settings({}), trajectory, 12.0, seed=5)
        base = Likelihood(RegressedFlights([log], VEHICLE), {}).base((), {})
        names = ("expected torque x", "torque x")
        at = base.at([Column("", name, Part.MODEL_ERROR) for name in names])
        predicted, all_of_it = base.total[at, at]
        sizes[trajectory] = math.sqrt(predicted / all_of_it)
    assert sizes["excite"] < 7.0
    assert sizes["hover"] > 5.0 * sizes["excite"]
