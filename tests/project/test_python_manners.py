"""What Python shows of this kit: short ``repr``, units in ``help``, and errors that say what came
in.
"""

import dataclasses
import inspect
import re
from importlib import import_module

import numpy as np
import pytest

from tests.support.diagnoses import made_diagnosis, made_trace
from windwrench.dynamics import EffectSetting, Mocap, Vehicle, load_vehicle
from windwrench.dynamics.effects.base import Coefficient, Effect
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.estimator import (
    NoiseFit,
    NoiseFitSettings,
    Recovery,
    TimedFilter,
    UKFTuning,
    WrenchUKF,
    WrenchUKFBatch,
)
from windwrench.identification import FlightLog
from windwrench.paper import ObserverTuning

DOCUMENTED = (
    *(Coefficient, Effect, EffectSetting, Mocap, MotorCurve, Vehicle),
    *(NoiseFit, NoiseFitSettings, ObserverTuning, Recovery),
    *(UKFTuning, FlightLog),
)
VEHICLE = load_vehicle("ardrone2")
POSE = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
SPEEDS = np.full(4, VEHICLE.hover_rate)


@pytest.mark.parametrize("kind", DOCUMENTED, ids=lambda kind: kind.__name__)
def test_help_says_what_each_field_is(kind):
    text = inspect.getdoc(kind)
    if kind is Vehicle and dataclasses.fields(kind):
        assert "mass: kg." in text
    described = set(re.findall(r"^ {4}(\w+): \S", text.split("Attributes:")[1], re.MULTILINE))
    own = [f for f in dataclasses.fields(kind) if f.name in kind.__annotations__]
    assert {f.name for f in own} - described == set()


def filters():
    ukf = WrenchUKF(VEHICLE)
    ukf.reset(*POSE)
    batch = WrenchUKFBatch(VEHICLE, 2)
    batch.reset(*POSE)
    return ukf, batch


def test_repr_is_short_and_says_what_it_is():
    ukf, batch = filters()
    assert repr(ukf) == "<WrenchUKF of ardrone2: period 0.005 s, tracking>"
    assert repr(batch) == "<WrenchUKFBatch of 2 x ardrone2: period 0.005 s>"
    estimate = ukf.step(SPEEDS, *POSE)
    assert repr(estimate).startswith("<WrenchEstimate tracking: force (")
    assert " Nm, NIS " in repr(estimate)
    assert "coasting" in repr(ukf.step(SPEEDS))
    assert repr(batch.step(np.tile(SPEEDS, (2, 1)))) == "<WrenchEstimate of 2: 2 coasting>"
    assert "0 late, 0 too late: <WrenchUKF" in repr(TimedFilter(ukf))
    made = made_diagnosis(made_trace(5.0))
    log = FlightLog(np.arange(3.0), np.zeros((3, 3)), np.tile(POSE[1], (3, 1)), np.ones((3, 4)))
    for thing, words in (
        (VEHICLE, "<Vehicle ardrone2: 0.465 kg, arm 0.126"),
        (made, "<Diagnosis explained: rotor_drag; force error "),
        (made.traces[0], "Trace(log='flight', period=0.04)"),
        (made.signatures[0], "Signature(effect='rotor_drag', channel='Fx', regressor="),
        (log, "<FlightLog without a name: 3 samples, 0 to 2 s>"),
    ):
        assert repr(thing).startswith(words)
        assert len(repr(thing)) < 160


@pytest.mark.parametrize(
    "package",
    ["", ".controllers", ".dynamics", ".envs", ".estimator", ".identification", ".paper"],
)
def test_a_prompt_shows_public_names_and_their_short_types(package):
    module = import_module(f"windwrench{package}")
    assert dir(module) == sorted(module.__all__)
    for name in dir(module):
        kind = getattr(module, name)
        for function in (kind, *vars(kind).values()) if inspect.isclass(kind) else (kind,):
            if inspect.isfunction(function) and not function.__name__.startswith("__"):
                assert len(str(inspect.signature(function))) < 400, (name, function)
