"""What coefficients do, in words; and ``report.json``, which keeps to its published schema."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.support.diagnoses import made_diagnosis, made_trace
from windwrench.dynamics import effects, load_vehicle
from windwrench.identification.findings import (
    Alternative,
    Disturbance,
    Errors,
    NamedEffect,
    Probabilities,
    Structure,
    TransientDisturbance,
)
from windwrench.identification.report import report_data, report_schema
from windwrench.identification.report.amounts import amount, title, with_amounts
from windwrench.identification.report.files import SCHEMA_VERSION
from windwrench.identification.report.headline import headline

VEHICLE = load_vehicle("crazyflie")


def named(name, **values):
    """An effect of which each coefficient is known to a tenth of it."""
    units = {c.name: c.unit for c in effects.get(name).coefficients}
    std = {key: 0.1 * abs(value) for key, value in values.items()}
    return NamedEffect(name, values, std, units, False, (), {})


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        (
            named("com_offset", cx=0.004, cy=-0.002, cz=0.0),
            "centre-of-mass offset up to 4.00 ± 0.40 mm forward",
        ),
        (named("mass", dm=0.005), "mass 5.00 ± 0.50 g"),
        (named("rotor_efficiency", e2=-0.12), "rotor efficiency −12.0 ± 1.2 % rotor 2"),
        (named("thrust_fade", rate=1e-3), "thrust fade 6.00 ± 0.60 % a minute"),
        (named("world_tilt", ax=0.01), "world tilt 0.573 ± 0.057 degrees about x"),
        (named("wind", wx=-8.4, wy=0.5, wz=0.0, cd=0.02), "wind 8.41 ± 0.84 m/s from +x"),
        (named("wind", wx=3.0, wy=-4.0), "wind 5.00 ± 0.37 m/s from −x +y"),
        (
            named("body_drag", dx=0.1, dy=0.2, dz=0.3, cx=0.4),
            "body drag up to 0.300 ± 0.030 N along z at 1 m/s",
        ),
    ],
)
def test_an_effect_is_told_by_what_it_does(effect, words):
    assert with_amounts(effect, VEHICLE).replace("\N{NO-BREAK SPACE}", " ") == words


def test_a_drag_is_told_by_its_force_on_four_rotors():
    found = amount(named("rotor_drag", kdx=1e-6), "kdx", VEHICLE)
    assert found.value == pytest.approx(1e3 * 4.0 * 1e-6 * VEHICLE.hover_rate)
    assert (found.unit, found.where, found.when) == ("mN", "along x", "at 1 m/s")


def test_each_effect_has_a_plain_name_and_a_quantity():
    titles = [title(name) for name in effects.names()]
    assert len(set(titles)) == len(titles)
    assert all(len(words) < 30 and "_" not in words for words in titles)
    for name in effects.names():
        for coefficient in (c.name for c in effects.get(name).coefficients):
            found = amount(named(name, **{coefficient: 1.0}), coefficient, VEHICLE)
            assert "rad/s m/s" not in found.unit
            assert found.value > 0.0


def test_a_steady_force_is_told_before_what_looks_random():
    """0.6 N along x beside a disturbance, of which no effect was named."""
    trace = made_trace(seconds=40.0, effects=(), seed=2)
    found = made_diagnosis(trace, verdict="unexplained", remainder="random", effects=())
    trace.after[:] -= np.mean(trace.after, axis=0)
    trace.after[:, 0] += 0.6
    assert headline(found).startswith("Unmodelled force 0.60")
    trace.after[:, 0] -= 0.6
    assert headline(found).startswith("The residual looks random; no effect in the library")
    gusts = replace(found, gusts=(Disturbance("Fx", 0.031, 0.3), Disturbance("tau_y", 0.003, 0.5)))
    assert "needed; the residual looks random, with gusts of 31" in headline(gusts)
    pushed = replace(gusts, pushes=(TransientDisturbance("Fx", "flight", 5.32, -0.58),))
    assert headline(pushed).startswith("Transient disturbances act, the clearest −0.58")


def said(*effects, unknown=0.1, **more):
    """The headline of a diagnosis that names effects."""
    stated = Probabilities({e.name: 0.9 for e in effects}, (), unknown)
    found = made_diagnosis(
        verdict="partly explained", effects=effects, probabilities=stated, **more
    )
    return headline(found).replace("\N{NO-BREAK SPACE}", " ").split(" Held-out")[0]


@pytest.mark.parametrize(
    ("after", "told"),
    [
        ((0.0550, 0.0011), "torque error: 2.10 mNm before, 1.10 mNm after (noise floor 1.90 mNm)."),
        (
            (0.0250, 0.0005),
            "torque error: 2.10 mNm before, 0.500 mNm after (noise floor 1.90 mNm); "
            "force error: 55.1 mN before, 25.0 mN after (noise floor 19.0 mN).",
        ),
        ((0.0550, math.nan), "force error: 55.1 mN before, 55.0 mN after (noise floor 19.0 mN)."),
    ],
)
def test_the_errors_that_fall_are_told(after, told):
    before, after = (Errors(*error, 7.1, 0.05) for error in ((0.0551, 0.0021), after))
    found = made_diagnosis(before=before, after=after)
    sentences = headline(found).replace("\N{NO-BREAK SPACE}", " ")
    assert sentences.partition(" Held-out ")[2] == told


def test_causes_stand_by_their_energy():
    sag, mass, scale, wind = (
        replace(effect, evidence={"energy_explained": energy})
        for effect, energy in (
            (named("battery_sag", n=1.0), 0.2),
            (named("mass", dm=0.005), 0.7),
            (named("thrust_scale", s=-0.05), 0.8),
            (named("wind", wx=-3.0), 0.5),
        )
    )
    told = said(sag, scale, wind, mass)
    places = [told.find(x) for x in ("scale", "mass", "wind", "; and 1 more.")]
    assert places == sorted(places)
    undecided = replace(scale, indistinguishable_from=("rotor_efficiency",))
    weak = replace(sag, evidence={"energy_explained": 0.01}, tentative=True)
    assert said(weak, undecided) == (
        "The model lacks thrust scale −5.00 ± 0.50 % or rotor efficiency; battery sag, exponent of "
        "the voltage ratio 1.00 ± 0.10 (perhaps)."
    )
    gusts = (Disturbance("Fx", 0.031, 0.3),)
    assert said(weak, gusts=gusts).endswith(
        "; the model perhaps lacks battery sag, exponent of the voltage ratio 1.00 ± 0.10."
    )


def test_a_doubt_stands_first_and_then_a_likely_cause_outside_the_library():
    told = said(named("mass", dm=0.005), unknown=0.75, notes=("a: warning: motors 1 and 2 agree",))
    assert told == (
        "Doubt: motors 1 and 2 agree. A cause outside the library acts (probability 75 %)."
    )


jsonschema = pytest.importorskip("jsonschema")


def test_a_report_keeps_to_its_schema():
    traces = (made_trace(5.0, ("rotor_drag", "wind"), log=f"log {i}") for i in range(2))
    lost = Errors(math.nan, math.inf, math.nan, 0.1)
    much = made_diagnosis(*traces, after=lost, rotor_faults=({"log": "log 0", "rotor": None},))
    bare = replace(much, verdict="nothing to explain", effects=(), traces=())
    (drag, _) = much.effects
    pushed = replace(
        much,
        remainder="structured",
        effects=(replace(drag, indistinguishable_from=("wind",)),),
        gusts=(Disturbance("Fx", 0.0153, 0.25),),
        pushes=(TransientDisturbance("tau_x", "flight", 1.5, -0.002),),
        structure=(Structure("a wave at 1.1 Hz", "Fx", 0.31),),
        probabilities=Probabilities({"wind": 0.95}, (Alternative((), 0.05),), 0.03),
    )
    for found in (much, bare, pushed):
        data = json.loads(json.dumps(report_data(found), allow_nan=False))
        jsonschema.validate(data, report_schema())
        assert data["schema_version"] == SCHEMA_VERSION
        # every key that is written is described
        assert set(data) == set(report_schema()["properties"])


def test_the_schema_is_one_and_refuses_what_is_no_report():
    schema = report_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    good = report_data(made_diagnosis())
    for key, wrong in (
        ("verdict", "perhaps"),
        ("effects", [{"name": "wind"}]),
        ("error", {}),
        ("schema_version", "2.0"),
        ("gusts", [{"channel": "F", "rms": 1.0, "time_s": 1.0}]),
    ):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**good, key: wrong}, schema)
    for key in good:
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({k: v for k, v in good.items() if k != key}, schema)
