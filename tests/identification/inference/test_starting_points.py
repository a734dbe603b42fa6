"""Where the search starts with effects whose force is no sum over their coefficients."""

import math

from tests.support.own_effects import joined
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.identification.inference.regression import Flights
from windwrench.identification.inference.starting_points import starting_points
from windwrench.studies.trials.practice_flights import fly_practice

VEHICLE = load_vehicle("ardrone2")


def test_a_wind_starts_along_itself_beside_a_steady_force_across_it():
    effects = (
        EffectSetting("wind", {"wx": 2.0, "wy": 1.0, "wz": 0.0, "cd": 0.04}),
        EffectSetting("constant_force", {"fx": 0.2, "fy": -0.4, "fz": 0.0}),
    )
    flights = Flights([fly_practice(VEHICLE, effects, "excite", 30.0, seed=1)], VEHICLE)
    starts = starting_points("wind", flights, flights.residual({}), {})
    off = [
        abs(
            math.degrees(
                math.remainder(math.atan2(s["wy"], s["wx"]) - math.atan2(1.0, 2.0), math.tau)
            )
        )
        for s in starts
    ]
    assert min(off) < 10.0
    assert max(off) > 30.0, "the mean force alone does not say where the wind goes"
    speeds = sorted({round(math.hypot(s["wx"], s["wy"]), 6) for s in starts})
    assert speeds[0] < 1.5 < 3.0 < speeds[-1]


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
