"""A diagnosis names what was added to a flight, and nothing where nothing was added."""

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from operator import attrgetter

import numpy as np
import pytest
from numpy.random import default_rng

from tests.support.data_paths import data_file
from tests.support.flown import without_pose
from tests.support.parameters import mostly_slow
from tests.support.vehicles import VEHICLE
from windwrench.dynamics import EffectSetting, Vehicle, load_vehicle
from windwrench.evidence.trials.practice_flights import fly_practice, practise
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.diagnosis.flight_rows import held_out
from windwrench.identification.diagnosis.regression import RegressedFlights
from windwrench.identification.diagnosis.settings import DiagnosisSettings
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.reading import read_log
from windwrench.identification.motion.sensor_noise import sensor_noise, with_noise


@cache
def fly(name="", trajectory="excite", seconds=25.0, **coefficients):
    effects = (EffectSetting(name, coefficients),) if name else ()
    return fly_practice(VEHICLE, effects, trajectory, seconds, seed=3)


def named(found):
    return [e.name for e in found.effects]


@pytest.mark.parametrize(
    ("name", "trajectory", "coefficients", "ratio"),
    [
        ("rotor_drag", "excite", {"kdx": 1.2e-4, "kdy": 0.9e-4}, 0.4),
        pytest.param("mass", "excite", {"dm": 0.04}, 0.4, marks=pytest.mark.slow),
    ],
)
def test_one_effect_is_named_with_its_coefficients(name, trajectory, coefficients, ratio):
    """The error is that of another flight where one is given: here of the same vehicle."""
    effect = EffectSetting(name, coefficients)
    test = fly_practice(VEHICLE, (effect,), trajectory, 15.0, seed=4)
    found = diagnose([fly(name, trajectory, **coefficients)], VEHICLE, [test])
    assert {where for where, _, _ in found.held_out_segments} == {test.name}
    assert named(found) == [name]
    assert found.verdict == "explained"
    assert not found.effects[0].tentative
    assert found.probabilities.names[name] > 0.99  # no ceiling
    assert found.probabilities.unknown < 0.2
    for key, value in coefficients.items():
        assert found.effects[0].coefficients[key] == pytest.approx(value, rel=0.05)
    assert found.after.force_rms < 1.2 * found.floor_force_rms
    assert found.after.torque_rms < 1.2 * found.floor_torque_rms
    assert found.before.force_rms > 1.5 * found.after.force_rms
    assert found.after.rollout_1s_position_rms < ratio * found.before.rollout_1s_position_rms
    assert [e.name for e in found.amended.effects] == [name]
    for trace in found.traces:  # the only effect's part is the difference, but for time offsets
        change = trace.before - trace.after
        assert np.std(trace.parts[name] - change) < 0.05 * np.std(change)


DRAG = {"kdx": 1.2e-4, "kdy": 1.2e-4}
OFFSET = {"cx": 0.005, "cy": 0.004, "cz": 0.005}
WIND = {"wx": 2.0, "wy": 1.0, "wz": 0.0, "cd": 0.04}
LOAD = {"m": 0.03, "l": 0.3, "damping": 1.0}
DECLARED = (
    ("rotor_drag", "excite", DRAG, {"kdx": 0.6e-4, "kdy": 0.6e-4}),
    ("com_offset", "shake", OFFSET, {"cz": 0.005}),
    ("latency", "excite", {"d": 0.03}, {"d": 0.01}),
    ("wind", "excite", WIND, {**WIND, "wx": 1.0}),
    ("slung_payload", "excite", LOAD, {"l": 0.3}),
)


@pytest.mark.parametrize(
    ("name", "trajectory", "truth", "declared"),
    [
        pytest.param(*case, marks=() if case[0] == "com_offset" else pytest.mark.slow)
        for case in DECLARED
    ],
)
def test_an_effect_that_is_declared_wrongly_or_in_part_is_corrected(
    name, trajectory, truth, declared
):
    vehicle = VEHICLE.with_effects(EffectSetting(name, declared))
    found = diagnose([fly(name, trajectory, **truth)], vehicle)
    (effect,) = found.effects
    assert effect.name == name
    assert not effect.tentative
    # no log of pose and rotor speeds tells a latency from a clock_offset
    undecided = bool(effect.indistinguishable_from)
    assert undecided == (name == "latency")
    assert (found.verdict, found.remainder) == (
        "partly explained" if undecided else "explained",
        "none",
    )
    for key, value in truth.items():
        error = effect.coefficients[key] - value
        assert abs(error) < (0.05 * abs(value) or 3.0 * effect.std[key])
    (amended,) = found.amended.effects
    assert {key: amended.coefficients[key] for key in effect.coefficients} == effect.coefficients


@dataclass(frozen=True)
class Case:
    """A flight, and what a diagnosis must say of it."""

    flight: Callable[[], tuple[FlightLog, Vehicle]]
    named: dict[str, bool] | None = None  # all names, and whether each is tentative
    among: str = ""  # a name that is one of them; then all are tentative
    verdict: str | None = None
    remainder: str | None = None
    where: str = ""  # pattern of a sign of structure
    without: tuple[str, ...] = ()


def drawn(*arguments):
    return lambda: attrgetter("log", "vehicle")(practise(VEHICLE, *arguments))


def made(name, trajectory="excite", **coefficients):
    return lambda: (fly(name, trajectory, 40.0, **coefficients), VEHICLE)


def practised(*arguments, **more):
    return lambda: (fly_practice(VEHICLE, *arguments, **more), VEHICLE)


def on_a_circle(*effects, outsider=None):
    return practised(effects, "circle", 60.0, 2, outsider, sensor=0.5)


UNEXPLAINED = {"named": {}, "verdict": "unexplained"}
CASES = {
    # a third of the rotors' inflow, which the library lacks, in twice the noise: what climbing
    # rotors lose is a drag along z, and what they lose as the body rolls damps its rolling
    "an inflow that the library lacks": Case(
        drawn("effect", ("inflow_thrust",), "small", "excite", 2388482033, 60.0),
        {"body_drag": False, "rate_damping": False},
        without=("inflow_thrust",),
    ),
    "a neighbour of the missing effect": Case(
        made("flapping_moment", "fast", kflap=4e-6), among="", without=("flapping_moment",)
    ),
    # more thrust is less mass, but for its torques
    "a mass that is not asked for": Case(
        made("mass", "vertical", dm=-0.013), **UNEXPLAINED, without=("mass",)
    ),
    "two behind four that stand for them": Case(
        drawn("pair", (), "typical", None, 3127511905, 60.0),
        {"attitude_gain": False, "battery_sag": False},
    ),
    # a battery's cell fails for seconds: no effect is so
    "what comes and goes": Case(
        drawn("outsider", ("failing_cell",), "small", None, 202), **UNEXPLAINED, remainder="random"
    ),
    # a camera on a mount of 2 Hz: slow turns are those of a larger inertia, but it swings
    "a soft mount": Case(
        drawn("outsider", ("loose_gimbal",), "small", None, 30), {"inertia": True}
    ),
    # noise takes from slow turns, where a mount would add to them
    "noise that takes from slow turns": Case(
        drawn("pair", (), "typical", None, 3979625931, 60.0),
        {"inertia": False, "body_drag": False},
    ),
    # in hover the flight loop answers noise, once as a mass would
    "a flight loop's answer to noise": Case(
        drawn("hover", ("rotor_efficiency",), "typical", None, 3995502488, 60.0),
        {"rotor_efficiency": False},
    ),
    # at one speed friction is a drag; how the flight begins says that it is none, if little more
    "friction on a circle": Case(on_a_circle(outsider="dry_friction"), among=""),
    # it is bent to the limits of a drag's law
    "quick: friction in climbs": Case(
        practised((), "vertical", 24.0, 3, "dry_friction", sensor=2.0), among=""
    ),
    "a drag on a circle": Case(
        on_a_circle(EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4})), {"rotor_drag": False}
    ),
    # its weight is that of a mass, and little is left of its swing
    "a load that the library lacks": Case(
        made("slung_payload", m=0.01, l=0.3, damping=1.0),
        {"mass": True},
        where=r"load that swings at (0\.|1 Hz)",
        without=("slung_payload",),
    ),
    # a sixtieth of the weight, to and fro, under the noise of the pose: the residual is at the
    # floor, and yet not calm
    "a force in the noise": Case(
        practised(
            seconds=40.0, seed=3, sensor=2.0, outsider="periodic_force", outsider_size=1.0 / 3.0
        ),
        **UNEXPLAINED,
        remainder="random",
    ),
}


@pytest.mark.parametrize("why", mostly_slow(CASES, lambda why: why.startswith("quick")))
def test_a_diagnosis_claims_what_a_flight_shows(why):
    case = CASES[why]
    log, vehicle = case.flight()
    found = diagnose([log], vehicle, without=case.without)
    if case.named is None:
        assert found.effects or found.verdict == "unexplained"
        assert all(e.tentative for e in found.effects)
        assert not set(named(found)) & set(case.without)
        assert case.among in (*named(found), "")
    else:
        assert {e.name: e.tentative for e in found.effects} == case.named
    assert found.verdict == (case.verdict or found.verdict)
    assert found.remainder == (case.remainder or found.remainder)
    said = [x.where for x in found.structure]
    assert not case.where or any(re.search(case.where, text) for text in said)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vehicle", "trajectory", "seconds", "truth"),
    [
        # on climbs one constant force does better than either of the two
        ("ardrone2", "vertical", 40.0, {"mass": {"dm": 0.045}, "thrust_curvature": {"a": 0.1}}),
        # four at once fill the model with two that stand for a third
        (
            "hummingbird",
            "fast",
            16.0,
            {
                "rotor_drag": {"kdx": 1.19e-4, "kdy": 1.19e-4},
                "translational_lift": {"kh": 3.39e-3},
                "inflow_thrust": {"kz": 2.32e-4},
                "body_drag": {"cx": 5e-3, "cy": 5e-3, "cz": 1e-2},
            },
        ),
    ],
)
def test_what_stands_for_others_gives_way(vehicle, trajectory, seconds, truth):
    model = load_vehicle(vehicle)
    effects = tuple(EffectSetting(name, coefficients) for name, coefficients in truth.items())
    more = {"seed": 2, "sensor": 0.5} if vehicle == "ardrone2" else {"turbulence": 0.0}
    found = diagnose([fly_practice(model, effects, trajectory, seconds, **more)], model)
    # of a drag and a lift so short a flight tells but roughly
    assert {*named(found), "body_drag"} == {*truth, "body_drag"}
    for effect in found.effects:
        for key, value in truth[effect.name].items():
            error = abs(effect.coefficients[key] - value)
            assert error < max(0.05 * abs(value), 3.0 * effect.std[key])


@pytest.mark.slow
def test_a_rotor_that_stalls_now_and_then_is_no_certain_curvature():
    """A tenth of the thrust beyond a tenth more than at hover is lost, in few moments."""
    log, vehicle = drawn("outsider", ("thrust_saturation",), "small", None, 2343211471, 60.0)()
    found = diagnose([log], vehicle)
    assert all(e.tentative for e in found.effects)
    assert found.probabilities.unknown > 0.5


def test_a_name_that_is_not_probable_enough_is_tentative():
    log = fly("thrust_curvature", seconds=16.0, a=-0.05)
    found = diagnose([log], VEHICLE, settings=DiagnosisSettings(least_sure_probability=1.0))
    assert 0.8 < found.probabilities.names["thrust_curvature"] < 1.0
    assert [(e.name, e.tentative) for e in found.effects] == [("thrust_curvature", True)]


def test_no_flight_keeps_step_with_what_is_held_out():
    """One block of each four, and not always the same one: of a flight that repeats itself all
    parts are held out in turn.
    """
    number = np.arange(400)
    held = number % 4 == held_out(number)
    assert (held.reshape(-1, 4).sum(axis=1) == 1).all()
    for period in range(2, 14):
        share = np.bincount(number % period, held) / np.bincount(number % period)
        assert np.all((share > 0.05) & (share < 0.5)), period
    flights = RegressedFlights([fly()], VEHICLE)
    assert np.array_equal(flights.fit_rows, flights.block % 4 != held_out(flights.block))


@pytest.mark.parametrize(("seconds", "every"), [(24.0, 5.0), (10.01, 99.0)])
def test_some_flight_is_held_out_of_short_pieces(seconds, every):
    """Pieces of less than four blocks, and a flight of three blocks, had no held-out error."""
    log = fly(seconds=seconds)
    lost = without_pose(log, (log.t - log.t[0] + 0.3) % every < 0.3)
    fitted = RegressedFlights([lost], VEHICLE).fit_rows
    assert 0.05 < 1.0 - fitted.mean() < 0.5


def test_sensor_noise_is_read_off_the_log():
    log = fly()
    rng = default_rng(0)
    noise = sensor_noise(log, VEHICLE)
    assert noise.position == pytest.approx(0.001, rel=0.05)
    assert noise.attitude == pytest.approx(0.005, rel=0.05)
    louder = sensor_noise(with_noise(log, noise, rng), VEHICLE)
    assert louder.position == pytest.approx(math.sqrt(2) * noise.position, rel=0.05)


@pytest.mark.parametrize("name", ["labelled_01", "labelled_02", "labelled_04"])
@pytest.mark.slow
def test_flights_of_another_simulator(name):
    """A hover and an unknown cause, of the same simulator: ``tests/golden/sentences.json``."""
    folder = data_file("flights")
    label = json.loads((folder / "labels.json").read_bytes())[f"{name}.csv.gz"]
    vehicle = load_vehicle(folder / "vehicle.yaml")
    found = diagnose([read_log(folder / f"{name}.csv.gz", None, vehicle)], vehicle)
    truth = {e["name"]: e for e in label["effects"]}
    assert set(named(found)) == set(truth)
    assert found.verdict == "explained"
    if label["turbulence_N_Nm_s"]:
        force, torque, time = label["turbulence_N_Nm_s"]
        size, lasting = (np.array([getattr(g, x) for g in found.gusts]) for x in ("rms", "time"))
        assert size[:3].mean() == pytest.approx(force, rel=0.2)
        assert size[3:].mean() == pytest.approx(torque, rel=0.4)  # of it, rotor speeds' rounding
        assert lasting[:3].mean() == pytest.approx(time, rel=0.3)
    for effect in found.effects:
        for key, value in effect.coefficients.items():
            if key in truth[effect.name]:
                assert value == pytest.approx(truth[effect.name][key], rel=0.05)
