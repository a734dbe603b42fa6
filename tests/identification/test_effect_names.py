"""A diagnosis knows effects by what they declare: their names may be any."""

import json
import re
from dataclasses import replace
from functools import cache

import pytest

from tests.support.alike import assert_alike
from tests.support.imu_flights import imu_flight, pose_removed
from tests.support.own_effects import renamed
from tests.support.vehicles import VEHICLE
from windwrench.dynamics import EffectSetting
from windwrench.dynamics.effects import names
from windwrench.evidence.trials.practice_flights import fly_practice
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.report.files import report_data

FLIGHTS = {
    "late": ("excite", {"latency": {"d": 0.03}}),
    "lag": ("excite", {"motor_lag": {"tau": 0.035}}),
    "wind": ("excite", {"wind": {"wx": 2.0, "wy": 1.0, "wz": 0.0, "cd": 0.04}}),
    "load": ("excite", {"slung_payload": {"m": 0.03, "l": 0.3, "damping": 1.0}}),
    "heavier": (
        "shake",
        {"mass": {"dm": 0.05}, "inertia": dict.fromkeys(("jx", "jy", "jz"), 0.12)},
    ),
    "clock": ("excite", {"attitude_gain": {"g": 0.08}, "clock_offset": {"dt": 0.02}}),
    "commanded": ("excite", {"latency": {"d": 0.03}, "battery_sag": {"n": 1.0}}),
    "imu": ("excite", {"thrust_axis_tilt": {"ax": 0.03, "ay": -0.02}}),
}


@cache
def flight(name):
    trajectory, truth = FLIGHTS[name]
    effects = tuple(EffectSetting(k, v) for k, v in truth.items())
    if name == "imu":
        return pose_removed(imu_flight(VEHICLE, effects, 20.0))
    log = fly_practice(VEHICLE, effects, trajectory, 12.0, seed=3)
    return replace(log, commanded=True) if name == "commanded" else log


def report(log, without=()):
    """Return report.json's dictionary as text."""
    return json.dumps(report_data(diagnose([log], VEHICLE, without=without)))


def called_back(text, new):
    """Return the text of a report with the names as they were."""
    for old, name in new.items():
        text = re.sub(rf"\b{name}\b", old, text)
    return without_plain_names(json.loads(text))


def without_plain_names(data):
    """Return a report without its headline: plain names are those that a library's files state."""
    return {key: value for key, value in data.items() if key != "headline"}


@pytest.mark.parametrize(
    "name",
    [name if name == "wind" else pytest.param(name, marks=pytest.mark.slow) for name in FLIGHTS],
)
def test_a_library_under_other_names_explains_the_same(name):
    log = flight(name)
    own = without_plain_names(json.loads(report(log)))
    assert own["effects"]
    order = {effect: i for i, effect in enumerate(names())}
    with renamed(lambda effect: f"law{order[effect]:02d}") as new:
        assert_alike(called_back(report(log), new), own)
