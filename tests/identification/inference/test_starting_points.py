"""Where the search starts with effects whose force is no sum over their coefficients."""

from tests.support.own_effects import joined
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.identification.inference.regression import Flights
from windwrench.identification.inference.starting_points import starting_points
from windwrench.studies.trials.practice_flights import fly_practice

VEHICLE = load_vehicle("ardrone2")


HOSE = '''"""A pull that comes and goes."""

import math

from numba import cfunc
from windwrench.dynamics.effects.base import EFFECT_MODEL, TIME, Coefficient, Effect


@cfunc(EFFECT_MODEL)
def model(c, vehicle, state, wrench):
    wrench[0] += c[0] * math.sin(2.0 * math.pi * c[1] * state[TIME])


EFFECT = Effect(
    name="hose",
    kind="wrench",
    coefficients=(
        Coefficient("a", "N", (0.15, 0.01), "pull"),
        Coefficient("f", "Hz", (0.5, 0.5), "frequency"),
    ),
    source="test",
    excitation="any flight",
    model=model,
    starting_points=lambda flights: [{"a": 0.15, "f": 0.2 + 0.02 * i} for i in range(60)],
)
'''


def test_of_many_starts_those_are_tried_that_resemble_the_flight(tmp_path):
    (tmp_path / "hose.py").write_text(HOSE)
    with joined(tmp_path):
        hose = EffectSetting("hose", {"a": 0.3, "f": 0.8})
        flights = Flights([fly_practice(VEHICLE, (hose,), "hover", 15.0, seed=1)], VEHICLE)
        starts = starting_points("hose", flights, flights.residual({}), {})
    assert len(starts) < 10
    assert abs(starts[0]["f"] - 0.8) < 0.03
