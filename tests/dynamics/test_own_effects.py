"""Effects in Python beside the same effects of the core, and their errors; equations of the core
beside their declarations.
"""

import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from tests.support.outcomes import refused
from tests.support.own_effects import HOSE, joined
from tests.support.vehicles import HOVER, POSE, VEHICLE
from windwrench import _core
from windwrench.dynamics import EffectSetting, effects
from windwrench.dynamics.effects.base import (
    HIDDEN,
    MEMORY,
    ROTORS_SIZE,
    ROW_SIZE,
    SAMPLE_SIZE,
    STATE_SIZE,
    VEHICLE_SIZE,
    Effect,
)
from windwrench.dynamics.effects.own import addresses, raise_errors
from windwrench.envs.recording import record_flight
from windwrench.estimator import WrenchUKF
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.prediction import predict
from windwrench.identification.wrench_series import estimate_log

HEADERS = Path(effects.__file__).parents[2] / "core/effects"


def motor_lag(c, vehicle, rotors, memory):
    started = memory[0] > 0.0
    memory[1:5] += (1.0 - math.exp(-rotors.step / c[0]) if started else 1.0) * (
        rotors.speed - memory[1:5]
    )
    memory[0] = 1.0
    rotors.speed = memory[1:5]


def marker_offset(c, vehicle, sample, memory):
    if sample.has_position:
        w, v, m = sample.quaternion[0], sample.quaternion[1:], c[:3]
        turned = m + 2.0 * np.cross(v, np.cross(v, m) + w * m)
        sample.position += sample.direction * turned


def felt_along(vehicle, state, damping, swing):
    """What vehicle and load feel apart, m/s2: thrust, and the air along the load's way."""
    felt = state.rotation[:, 2] * state.thrust.sum() / vehicle.mass
    return felt + damping * (state.velocity + swing - state.wind)


def slung_payload(c, vehicle, state, wrench):
    mass, length, damping = c[:3]
    started, n, rate = c[HIDDEN], c[HIDDEN + 1 : HIDDEN + 4], c[HIDDEN + 4 : HIDDEN + 7]
    n = n if started else np.array([0.0, 0.0, -1.0])
    felt = felt_along(vehicle, state, damping, length * rate)
    tension = max((length * rate @ rate - n @ felt) / (1.0 / mass + 1.0 / vehicle.mass), 0.0)
    wrench.force += tension * n
    wrench.torque -= np.cross(vehicle.com, state.rotation.T @ (tension * n))


def advance(c, vehicle, state, rotors):
    length, damping = c[1], c[2]
    own = c[HIDDEN : HIDDEN + 7]
    if own[0] == 0.0:
        own[0], own[3] = 1.0, -1.0
    n, rate = own[1:4], own[4:7]
    felt = felt_along(vehicle, state, damping, length * rate)
    pull = max(length * rate @ rate - n @ felt, 0.0)
    rate -= rotors.step * (felt + pull * n) / length
    n += rotors.step * rate
    n /= np.linalg.norm(n)
    rate -= (n @ rate) * n


CALLS = {  # the arrays after coefficients and vehicle, and the effect's own Python functions
    "motor_lag": (ROTORS_SIZE, MEMORY, motor_lag, None),
    "marker_offset": (SAMPLE_SIZE, MEMORY, marker_offset, None),
    "slung_payload": (STATE_SIZE, 6, slung_payload, advance),
}


@pytest.mark.parametrize("name", CALLS)
def test_an_effect_in_python_is_the_one_of_the_core(name):
    third_size, fourth_size, model, carried = CALLS[name]
    known = effects.get(name)
    own = Effect(name, known.kind, known.coefficients, "", "", model=model, advance=carried)
    rng = default_rng(1)
    vehicle = rng.uniform(0.5, 1.5, VEHICLE_SIZE)
    given = [rng.standard_normal((third_size, 200)), rng.standard_normal((ROTORS_SIZE, 200))]
    given[0][4 if name == "motor_lag" else 11] = given[1][4] = 0.005
    if third_size == STATE_SIZE:
        given[0][3:12] = Rotation.random(200, 1).as_matrix().reshape(200, 9).T
    if name == "marker_offset":  # a rotation; in every second row there is a position
        given[0][7:11] /= np.linalg.norm(given[0][7:11], axis=0)
        given[0][13] = np.arange(200) % 2
    got = []
    for equation, carry in (addresses(known), addresses(own)):
        c, memory, rows = np.zeros(ROW_SIZE), np.zeros(fourth_size), []
        c[: len(known.coefficients)] = [k.typical[0] for k in known.coefficients]
        for third, rotors in zip(*(np.ascontiguousarray(x.T) for x in given), strict=True):
            values = third.copy()
            if carry:
                _core.call_effect(carry, c, vehicle, values, rotors)
            _core.call_effect(equation, c, vehicle, values, memory)
            rows.append(np.concatenate([c, values, memory]))
        got.append(np.array(rows))
    raise_errors()
    assert np.ptp(got[0][:, ROW_SIZE:], axis=0).max() > 0.1
    assert_allclose(got[1], got[0], rtol=1e-10, atol=1e-12)


STARTS = "starting_points=lambda flights: [{'a': 0.2, 'w': 3.0}]"
SWAYING = EffectSetting("hose", {"a": 0.2, "w": 3.0})


@pytest.fixture
def hose(tmp_path):
    """A vehicle whose own effect has an error that no state at loading shows."""
    early = "    if 0.1 < state.time < 0.4:\n        wrench.force = state.velosity\n    wrench."
    text = HOSE.replace("# more", STARTS).replace("    wrench.", early)
    (tmp_path / "hose.py").write_text(text)
    with joined(tmp_path):
        yield VEHICLE.with_effects(SWAYING)


SLIP = r"hose\.py, line 10: effect hose: AttributeError: no field velosity"


def test_an_error_in_an_effect_is_one_line_after_the_step_and_the_filter_goes_on(hose):
    ukf = WrenchUKF(hose)
    ukf.reset(*POSE)
    for _ in range(20):
        ukf.step(HOVER, *POSE)
    with refused(SLIP):
        ukf.step(HOVER, *POSE)
    ukf.record["time"] = 0.0
    assert np.isfinite(ukf.step(HOVER, *POSE).force).all()


def test_an_error_in_an_effect_ends_a_flight_and_what_is_made_of_a_log(hose):
    with refused(SLIP):
        record_flight(VEHICLE, (SWAYING,), "hover", 1.0, 1)
    log = FlightLog(**record_flight(VEHICLE, (), "hover", 4.0, 1))
    for use in (estimate_log, partial(estimate_log, smooth=True), predict):
        with refused(SLIP):
            use(log, hose)


def test_an_error_at_any_state_shows_when_the_effect_is_loaded(tmp_path):
    (tmp_path / "hose.py").write_text(HOSE.replace("# more", STARTS).replace("math.sin", "sin"))
    with joined(tmp_path), refused(r"hose\.py, line 9: effect hose: NameError: .*'sin'"):
        effects.get("hose")


def test_a_field_that_no_record_has_cannot_be_set(tmp_path):
    text = HOSE.replace("# more", STARTS).replace("wrench.force[0] +=", "wrench.forces = 1 +")
    (tmp_path / "hose.py").write_text(text)
    with joined(tmp_path), refused("no field forces; expected one of force, torque"):
        effects.get("hose")


def test_a_model_that_the_core_has_not_is_named():
    with refused("effect hose: model 'hose' is no wrench of the core"):
        addresses(Effect("hose", "wrench", (), "", "", model="hose"))
    with refused("'motor_lag' is no wrench"):
        addresses(Effect("hose", "wrench", (), "", "", model="motor_lag"))


@pytest.mark.parametrize("name", effects.names())
def test_an_equation_s_header_names_its_declaration(name):
    effect = effects.get(name)
    if effect.kind == "body":
        assert effect.model is None
        return
    assert effect.model == name
    assert addresses(effect)[0] > 0
    title = effects.model_in_words(name).partition(":")[0]
    begun = f"// {title}: dynamics/effects/{name}.py has the equation in words.\n"
    assert (HEADERS / f"{name}.hpp").read_text().startswith(begun)
