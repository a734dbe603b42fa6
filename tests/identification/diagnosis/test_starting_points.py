"""Where the search starts with effects whose force is no sum over their coefficients."""

from tests.support.own_effects import HOSE, joined
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.identification.diagnosis.regression import Flights
from windwrench.identification.diagnosis.starting_points import starting_points
from windwrench.studies.trials.practice_flights import fly_practice

VEHICLE = load_vehicle("ardrone2")

STARTS = "starting_points=lambda flights: [{'a': 0.15, 'w': 1.25 + 0.125 * i} for i in range(60)]"


def test_of_many_starts_those_are_tried_that_resemble_the_flight(tmp_path):
    (tmp_path / "hose.py").write_text(HOSE.replace("# more", STARTS))
    with joined(tmp_path):
        hose = EffectSetting("hose", {"a": 0.3, "w": 5.0})
        flights = Flights([fly_practice(VEHICLE, (hose,), "hover", 15.0, seed=1)], VEHICLE)
        starts = starting_points("hose", flights, flights.residual({}), {})
    assert len(starts) < 10
    assert abs(starts[0]["w"] - 5.0) < 0.19
