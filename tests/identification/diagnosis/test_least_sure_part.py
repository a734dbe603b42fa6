"""A diagnosis claims no more than its least sure part: logs of commands alone, filtered poses, and
effects that a flight cannot tell apart.
"""

from dataclasses import replace

import pytest

from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.diagnosis.commanded_rotors import COMMANDED
from windwrench.identification.diagnosis.regression import lost_behind_a_filter
from windwrench.identification.report.headline import headline
from windwrench.studies.trials.logged_poses import FILTERS
from windwrench.studies.trials.practice_flights import fly_practice

VEHICLE = load_vehicle("ardrone2")


def fly(name, trajectory="excite", seconds=20.0, seed=1, **coefficients):
    return fly_practice(VEHICLE, (EffectSetting(name, coefficients),), trajectory, seconds, seed)


@pytest.mark.parametrize(
    ("name", "value"), [("thrust_scale", {"s": -0.08}), ("mass", {"dm": 0.05})]
)
def test_a_factor_on_thrust_from_commands_alone_is_never_sure(name, value):
    log = replace(fly(name, **value), commanded=True)
    found = diagnose([log], VEHICLE)
    factors = [e for e in found.effects if e.name in ("thrust_scale", "mass")]
    assert factors
    for effect in factors:
        (other,) = {"thrust_scale", "mass"} - {effect.name}
        assert effect.tentative
        assert other in effect.indistinguishable_from
        size = COMMANDED.unstated_thrust_std * (VEHICLE.mass if effect.name == "mass" else 1.0)
        assert all(std >= size for std in effect.std.values())
        assert any(
            note.startswith(f"{effect.name}: the log holds motor commands") for note in found.notes
        )
    assert found.verdict == "partly explained"
    assert headline(found).startswith("These logs cannot tell ")


@pytest.mark.parametrize(
    ("name", "filtered", "coefficients"),
    [
        ("rotor_drag", "causal 5 Hz", {"kdx": 2e-4, "kdy": 1.5e-4}),
        pytest.param("com_offset", "extended Kalman filter", {"cx": 0.01}, marks=pytest.mark.slow),
    ],
)
def test_names_behind_a_filter_are_the_same_but_tentative(name, filtered, coefficients):
    log = FILTERS[filtered](fly(name, **coefficients), VEHICLE)
    found = diagnose([log], VEHICLE)
    assert found.floor_is_bound
    assert name in {e.name for e in found.effects}
    assert all(e.tentative for e in found.effects)
    assert not lost_behind_a_filter() & {e.name for e in found.effects}
    assert found.verdict == "partly explained"
    assert "perhaps" in headline(found)
    assert found.advice[0].startswith("Log the pose as it was measured")
    assert any("position and attitude were filtered" in note for note in found.notes)
    (effect,) = (e for e in found.effects if e.name == name)
    for key, value in coefficients.items():
        assert abs(effect.coefficients[key] - value) < max(4.0 * effect.std[key], 0.15 * abs(value))


def test_a_filters_delay_is_no_late_motor():
    found = diagnose(
        [FILTERS["causal 10 Hz"](fly_practice(VEHICLE, (), "excite", 20.0, 4), VEHICLE)], VEHICLE
    )
    assert not [e for e in found.effects if not e.tentative]
    assert not lost_behind_a_filter() & {e.name for e in found.effects}
    assert any(
        "later than they are logged, or the filter of the pose delays it" in n for n in found.notes
    )


@pytest.mark.slow
def test_what_a_flight_cannot_tell_apart_is_the_headline():
    log = fly("latency", d=0.03)
    found = diagnose([log], VEHICLE)
    (effect,) = found.effects
    assert effect.indistinguishable_from
    assert found.verdict == "partly explained"
    assert headline(found).startswith("These logs cannot tell ")
