"""Parts of a diagnosis, each by itself: what carries a finding, what may stand for another, where a
search starts, and delays of rotors.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.support.flown import VEHICLE, recorded, resting, settings
from tests.support.own_effects import HOSE, joined
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.evidence.trials.practice_flights import fly_practice
from windwrench.identification.diagnosis.advice import cancelling, composites
from windwrench.identification.diagnosis.column import Column
from windwrench.identification.diagnosis.commanded_rotors import TAKE_OFF, in_flight_by_thrust
from windwrench.identification.diagnosis.log_offsets import LAG_ASYMMETRY, delays_at_bound
from windwrench.identification.diagnosis.priors import prior_size
from windwrench.identification.diagnosis.ranking import rank
from windwrench.identification.diagnosis.regression import RegressedFlights
from windwrench.identification.diagnosis.starting_points import _starting_points, starts_of
from windwrench.identification.diagnosis.traces import ORDER, carrying_channels
from windwrench.identification.diagnosis.turning_delay import turning_delay
from windwrench.identification.motion.signals import log_signals
from windwrench.identification.motion.smoothing import low_pass

CASES = {
    "constant_torque": ({"tx": 0.01, "ty": 0.01, "tz": 0.0}, {"attitude"}, {"rotor speeds"}),
    "rotor_drag": ({"kdx": 1e-4, "kdy": 1e-4}, {"position", "attitude", "rotor speeds"}, set()),
    "battery_sag": ({"n": 1.0}, {"position", "rotor speeds", "battery voltage"}, {"gyro"}),
    "mass": ({"dm": 0.05}, {"position"}, {"battery voltage"}),
}


@pytest.mark.parametrize("effect", CASES)
def test_channels_are_those_of_the_trace_and_of_the_model(effect):
    coefficients, carried, others = CASES[effect]
    log = recorded(seconds=12.0, **{effect: coefficients})
    found = carrying_channels(RegressedFlights([log], VEHICLE), {effect: coefficients}, effect)
    assert carried <= set(found)
    assert not others & set(found)
    assert list(found) == [channel for channel in ORDER if channel in found]


LIGHTER = {"mass": {"dm": -0.1 * VEHICLE.mass}}
WEAKER = {"thrust_scale": {"s": -0.1}}
SLUGGISH = {"inertia": {"jx": -0.1, "jy": -0.1, "jz": -0.1}}
STIFFER = {"inertia": {"jx": 0.1, "jy": 0.1, "jz": 0.1}}


@pytest.mark.parametrize(
    ("setting", "third"),
    [
        (LIGHTER | WEAKER, "inertia"),
        (WEAKER | SLUGGISH, "mass"),
        (LIGHTER | SLUGGISH, "thrust_scale"),
        (LIGHTER | STIFFER, ""),
        (LIGHTER, ""),
    ],
)
def test_two_that_change_alike_may_be_a_third(setting, third):
    sized = {effect: (values, dict.fromkeys(values, 0.002)) for effect, values in setting.items()}
    found = list(composites(VEHICLE, sized))
    assert len(found) == bool(third)
    assert all(third in sentence.split(": ")[1] for sentence in found)


def test_effects_that_cancel_are_told_by_their_sum():
    lift, load, drag = np.outer([0.25, -0.22, 0.2], np.eye(6)[2])[:, None]
    (told,) = cancelling({"lift": lift, "load": load}, 0.1 * np.eye(6))
    assert told.endswith("their sum, 0.03 N")
    assert not [*cancelling({"lift": lift, "drag": drag}, 0.1 * np.eye(6))]


STARTS = "starting_points=lambda flights: [{'a': 0.15, 'w': 1.25 + 0.125 * i} for i in range(60)]"


def test_of_many_starts_those_are_tried_that_resemble_the_flight(tmp_path):
    (tmp_path / "hose.py").write_text(HOSE.replace("# more", STARTS))
    with joined(tmp_path):
        hose = EffectSetting("hose", {"a": 0.3, "w": 5.0})
        flights = RegressedFlights([fly_practice(VEHICLE, (hose,), "hover", 15.0, seed=1)], VEHICLE)
        starts = _starting_points("hose", flights, flights.residual({}))
    assert len(starts) < 10
    assert abs(starts[0]["w"] - 5.0) < 0.19


@pytest.mark.parametrize("beside", [[], ["rotor_drag"]])
def test_a_wind_may_act_on_another_drag_alone(beside):
    flights = RegressedFlights([recorded(seconds=12.0)], VEHICLE)
    starts = _starting_points("wind", flights, flights.residual({}), beside)
    assert any(start["cd"] == 0.0 for start in starts) == bool(beside)


def test_an_effect_may_start_in_the_place_of_another():
    """A force that is known already leaves nothing of the wind that would explain it."""
    force = {"constant_force": {"fx": 0.3, "fy": 0.0, "fz": 0.0}}
    flights = RegressedFlights([recorded(seconds=12.0, **force)], VEHICLE)
    found = starts_of(flights, ["wind"], force, {}).values()
    assert any(start["wx"] > 3.0 * abs(start["wy"]) for start in found)


def test_only_the_time_in_the_air_counts():
    log = resting(np.arange(4001) / 200.0)
    speeds = log.rotor_speeds.copy()
    speeds[(log.t < 4.0) | (log.t > 15.0)] *= 0.3
    found = in_flight_by_thrust(replace(log, rotor_speeds=speeds), VEHICLE)
    # taking off and landing last beyond
    assert found.t[0] == pytest.approx(4.0 + TAKE_OFF, abs=0.5)
    assert found.t[-1] == pytest.approx(15.0 - TAKE_OFF, abs=0.5)
    assert len(in_flight_by_thrust(log, VEHICLE).t) == len(log.t)


def flown_signals(vehicle, **effects):
    return log_signals(recorded(seed=3, vehicle=vehicle, **effects))


@pytest.mark.parametrize("vehicle", ["ardrone2", "crazyflie"])
def test_the_delay_that_was_flown(vehicle):
    model = load_vehicle(vehicle)
    found = turning_delay(flown_signals(model, latency={"d": 0.035}), model)
    assert found is not None
    seconds, std, _ = found
    assert seconds == pytest.approx(0.035, abs=0.004)
    assert std < 0.004


def test_a_declared_lag_is_no_part_of_the_delay():
    lag = {"motor_lag": {"tau": 0.04}}
    model = load_vehicle("ardrone2").with_effects(*settings(lag))
    assert turning_delay(flown_signals(VEHICLE, **lag), model) is None
    found = turning_delay(flown_signals(VEHICLE, **lag, latency={"d": 0.03}), model)
    assert found is not None
    assert found[0] == pytest.approx(0.03, abs=2.0 * found[1])
    assert found[1] < 0.006


def test_delays_of_two_flights_are_no_surer_than_they_agree():
    model = load_vehicle("ardrone2")
    early, late = (flown_signals(model, latency={"d": d}) for d in (0.02, 0.03))
    seconds, std, _ = turning_delay([*early, *late], model)
    assert 0.003 < std < 0.01
    assert seconds == pytest.approx(0.025, abs=2.0 * std)


def test_moments_of_another_flight_show_no_delay():
    model = load_vehicle("ardrone2")
    pieces = [
        replace(s, rotor_speeds=np.ascontiguousarray(s.rotor_speeds[::-1]))
        for s in flown_signals(model)
    ]
    assert turning_delay(pieces, model) is None
    assert turning_delay([], model) is None


TAU = 0.03  # s: 22 ms up, 38 ms down
APART = 0.008


def unevenly_lagging(commanded):
    """A flight, and its log with the commands that such a lag turns into its rotor speeds."""
    log = recorded(seconds=12.0, seed=3)
    speeds = low_pass(log.rotor_speeds, 30.0, log.period)  # slower, a lag would make up for it
    rate = np.gradient(speeds, log.period, axis=0)
    tau = np.where(rate > 0.0, TAU - APART, TAU + APART)
    return replace(log, rotor_speeds=speeds + tau * rate if commanded else speeds)


def test_a_lag_that_is_uneven_leaves_no_mass():
    """The mass is that of a fit to the rotor speeds themselves, which are smoothed here."""
    library = ["motor_lag", "mass"]
    known = rank(
        RegressedFlights([unevenly_lagging(commanded=False)], VEHICLE), library, print
    ).ranking.sets[0]
    found = rank(RegressedFlights([unevenly_lagging(commanded=True)], VEHICLE), library, print)
    assert found.needed["motor_lag"]["tau"] == pytest.approx(TAU, abs=0.006)
    apart, _ = found.posterior.nuisances()[LAG_ASYMMETRY]
    assert 0.5 * APART < apart < 1.5 * APART
    off = [x.coefficients.get("mass", {"dm": 0.0})["dm"] for x in (found.ranking.sets[0], known)]
    assert abs(off[0] - off[1]) < 0.001 * VEHICLE.mass


def test_a_hanging_load_of_half_the_vehicles_mass_is_expected():
    """A prior of a tenth of that mass told measured loads of a half too small by a third."""
    flights = SimpleNamespace(vehicle=load_vehicle("crazyflie"), thrust_std=0.0)
    assert 0.5 * flights.vehicle.mass < 2.0 * prior_size(Column("slung_payload", "m"), flights)


@pytest.mark.parametrize(
    ("effect", "name", "bound"),
    [("clock_offset", "dt", -0.06), ("clock_offset", "dt", 0.06), ("latency", "d", 0.1)],
)
def test_a_delay_at_the_bound_of_its_search_is_said(effect, name, bound):
    (line,) = delays_at_bound({effect: {name: bound}, "mass": {"dm": 0.01}, "": {"offset": 1.0}})
    assert line.startswith(f"{effect}: the search ends at {1000 * bound:.3g} ms")
    assert list(delays_at_bound({effect: {name: 0.9 * bound}})) == []
