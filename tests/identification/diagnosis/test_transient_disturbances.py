"""What comes now and then is no gust of a steady strength, however little it is over a whole
flight.
"""

from dataclasses import replace

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.diagnosis.regression import Flights
from windwrench.identification.diagnosis.transient_disturbances import transient_disturbances
from windwrench.identification.report.words import remainder_sentence
from windwrench.studies.trials.practice_flights import fly_practice, practise

VEHICLE = load_vehicle("ardrone2")


def test_a_wash_that_passes_now_and_then_is_found_where_it_was():
    """A third of it, 0.05 weights for half a second, in twice the noise: as steady gusts it is next
    to nothing.
    """
    flown = practise(VEHICLE, "outsider", ("passing_wash",), "small", None, 3628941416)
    found = diagnose([flown.log], flown.vehicle)
    assert (found.verdict, found.remainder, found.effects) == ("unexplained", "random", ())
    (down,) = (push for push in found.pushes if push.channel == "Fz")
    near = np.abs(flown.log.t - down.t) < 0.3
    truth = flown.log.force[:, 2]
    assert truth[near].min() == pytest.approx(truth.min(), rel=0.1)
    assert down.peak == pytest.approx(truth.min(), rel=0.3)
    sentence = remainder_sentence(found)
    assert "transient disturbances" in sentence
    assert f"in {found.pushes[0].channel} at" in sentence
    assert f"of {flown.log.name}" in remainder_sentence(replace(found, test_logs=("another",)))


@pytest.mark.parametrize("turbulence", [0.0, 1.0, 4.0])
def test_gusts_of_a_steady_strength_are_no_pushes(turbulence):
    log = fly_practice(VEHICLE, seconds=40.0, seed=5, turbulence=turbulence)
    assert transient_disturbances(Flights([log], VEHICLE), {}) == []


def test_it_is_said_in_which_log_the_push_was():
    calm = fly_practice(VEHICLE, seconds=20.0, seed=6)
    force = np.where((calm.t > 12.0) & (calm.t < 12.5), 0.1 * VEHICLE.weight, 0.0)
    # what moves it in the log alone: an acceleration that no rotor has made
    moved = np.cumsum(np.cumsum(force / VEHICLE.mass)) * calm.period**2
    pushed = replace(calm, name="pushed", position=calm.position + np.outer(moved, [1.0, 0.0, 0.0]))
    (push,) = transient_disturbances(Flights([calm, pushed], VEHICLE), {})
    assert (push.log, push.channel) == ("pushed", "Fx")
    assert push.t == pytest.approx(12.25, abs=0.1)
    assert push.peak == pytest.approx(0.1 * VEHICLE.weight, rel=0.3)
