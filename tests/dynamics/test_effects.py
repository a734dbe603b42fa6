"""What effects declare, and one effect in three uses: every effect of the library is described,
flown by the plant and used by the estimator.
"""

import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

from tests.support.outcomes import refused
from tests.support.own_effects import HOSE, joined
from tests.support.parameters import mostly_slow
from windwrench.dynamics import EffectSetting, Mocap, load_vehicle
from windwrench.dynamics.effects import (
    Family,
    Need,
    Role,
    get,
    names,
    needing,
    of_family,
    parse_setting,
    playing,
)
from windwrench.dynamics.effects.declaration import Found
from windwrench.dynamics.effects.vanishing import does_nothing_alone
from windwrench.envs.plant import NOISE, TICK, PlantSettings
from windwrench.envs.recording import draw_trajectory, record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.wrench_series import estimate_log
from windwrench.reproduction.suspended_load import LoadedLoop, SuspendedLoad

# nothing but the effect comes between model and flight: no disturbance, no lag, no quantised
# rotor speeds, no noise
QUIET = PlantSettings(
    disturbance_force=0.0, disturbance_torque=0.0, motor_lag=0.0, sensor_noise=False
)
VEHICLE = replace(load_vehicle("ardrone2"), omega_lsb=0.0, mocap=Mocap(200.0, 1e-4, 5e-4))
# where an effect shows; "excite" shows most of them
FLIGHTS = {"ground_effect": "ground"}
# one effect of each kind
SHOWN = ("motor_lag", "rotor_drag", "com_offset", "marker_offset")
CEILING = replace(VEHICLE, ceiling_z=2.1)  # "excite" comes near it
LEAST_GAIN = 3.0  # by how much declaring an effect lowers the RMS of the wrench that is left


def vehicle_for(name):
    return CEILING if name == "ceiling_effect" else VEHICLE


def remaining(log, vehicle):
    """RMS of the estimated wrench, in parts of weight and of weight times arm, once the filter has
    settled.
    """
    series = estimate_log(log, vehicle)
    settled = series.t > 4.0
    wrench = np.concatenate(
        [series.force / vehicle.weight, series.torque / (vehicle.weight * vehicle.arm_l)], axis=1
    )
    return np.sqrt(np.mean(np.sum(wrench[settled] ** 2, axis=1)))


@pytest.mark.parametrize("name", names())
def test_an_effect_says_what_it_is(name):
    effect = get(name)
    assert effect.name == name
    assert effect.kind in ("rotor input", "wrench", "body", "sensing")
    assert effect.source.strip()
    assert effect.excitation.strip()
    assert len((sys.modules[f"windwrench.dynamics.effects.{name}"].__doc__ or "").strip()) > 40
    assert 0 < len(effect.coefficients) <= 8
    assert len({c.name for c in effect.coefficients}) == len(effect.coefficients)
    for c in effect.coefficients:
        assert c.unit.strip()
        assert c.meaning.strip()
        assert all(np.isfinite(size) and c.minimum <= size <= c.maximum for size in c.typical)
    for size in (0, 1):
        assert any(c.typical[size] != 0 for c in effect.coefficients)


@pytest.mark.parametrize("name", mostly_slow(names(), SHOWN.__contains__))
def test_the_estimator_explains_an_effect_that_the_plant_flies_once_it_is_declared(name):
    vehicle = vehicle_for(name)
    setting = parse_setting(name, VEHICLE)
    trajectory = FLIGHTS.get(name, "excite")
    log = FlightLog(**record_flight(vehicle, (setting,), trajectory, 12.0, 1, QUIET))
    explained = remaining(log, vehicle.with_effects(setting))
    assert explained < remaining(log, vehicle) / LEAST_GAIN


def test_a_slung_payload_explains_a_load_that_hangs_in_mujoco():
    """The load and its thread there share nothing with the effect's equation."""
    load = SuspendedLoad(mass=0.03, length=0.3, anchor=(0.0, 0.0, 0.0), drag=0.03)
    rng = default_rng(1)
    t = TICK * np.arange(2401)
    setpoints = draw_trajectory("excite", rng, t)
    samples = np.empty((len(t), 11))
    loop = LoadedLoop(VEHICLE, settings=QUIET, load=load)
    loop.reset(rng, setpoints[0, :3], float(setpoints[0, 9]))
    loop.hang_load()
    for k in range(len(t)):
        loop.setpoint[:] = setpoints[k]
        samples[k, :4] = loop.sample[:4]
        loop.run(rng.standard_normal((1, NOISE)))
        samples[k, 4:] = loop.sample[4:]
    log = FlightLog(t, samples[:, 4:7], samples[:, 7:11], samples[:, :4])
    swinging = EffectSetting(
        "slung_payload", {"m": load.mass, "l": load.length, "damping": load.drag / load.mass}
    )
    explained = remaining(log, VEHICLE.with_effects(swinging))
    assert explained < 0.1 * remaining(log, VEHICLE)
    assert explained < 0.3 * remaining(
        log, VEHICLE.with_effects(EffectSetting("mass", {"dm": load.mass}))
    )


def test_a_bare_name_takes_the_sizes_of_the_vehicle_unless_they_are_said():
    sizes = get("rotor_drag").coefficients[0].typical
    for size, vehicle in zip(sizes, (None, load_vehicle("crazyflie")), strict=True):
        assert parse_setting("rotor_drag", vehicle).coefficients["kdx"] == size
    setting = parse_setting("rotor_drag:kdx=1e-4, kdy=2e-4")
    assert setting == EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 2e-4})


def test_effects_are_looked_up_by_what_they_declare():
    assert replace(get("mass"), role="mass").role == Role.MASS
    assert playing(Role.LAG, Role.MASS) == (*playing(Role.LAG), *playing(Role.MASS))
    assert playing(Role.MASS, among=["wind"]) == ()
    for family in Family:
        assert all(get(name).family == family for name in of_family(family))
    assert sum(len(of_family(family)) for family in Family) == len(names())
    assert needing(Need.FAST_MOTION) < needing(Need.FINE_ROTOR_SPEEDS)
    assert needing(Need.FAST_MOTION, Need.MOMENTS) == needing(Need.FAST_MOTION) | needing(
        Need.MOMENTS
    )


@pytest.mark.parametrize("name", names())
def test_an_effect_does_something_one_by_one_or_says_where_to_start(name):
    assert not does_nothing_alone(get(name)) or get(name).starting_points is not None


def test_a_law_that_does_nothing_one_by_one_must_say_where_to_start(tmp_path):
    (tmp_path / "hose.py").write_text(HOSE)
    starts = "starting_points=lambda flights: [{'a': 0.2, 'w': 3.0}]"
    started = HOSE.replace("# more", starts).replace('"hose"', '"told_hose"')
    (tmp_path / "told_hose.py").write_text(started)
    with joined(tmp_path):
        with refused(r"hose\.py: effect hose: .*add starting_points="):
            get("hose")
        assert get("told_hose").starting_points is not None


def test_joint_bounds_are_those_of_physics():
    vehicle = load_vehicle("ardrone2")
    load = get("slung_payload")
    assert load.possible({"m": 0.03, "l": 0.3, "damping": 1.0}, vehicle)
    assert not load.possible({"m": 0.03, "l": 0.3, "damping": 5.0}, vehicle)

    def asked(name, beside=(), **found):
        typical = {c.name: c.typical[0] for c in get(name).coefficients}
        return get(name).implausible(Found(found, {}, typical, 1.0, frozenset(beside)))

    assert "hardly any drag" in asked("wind", wx=6.0, cd=1e-3)
    assert not asked("wind", [Family.DRAG], wx=6.0, cd=1e-3)
    assert "z alone" in asked("rate_damping", dx=0.0, dy=0.0, dz=1e-3)
    assert not asked("rate_damping", dx=1e-3, dy=1e-3, dz=1e-3)
    assert "some axes" in asked("body_drag", dx=0.0, dy=0.05, dz=0.1)
    assert not asked("body_drag", dx=0.05, dy=0.05, dz=0.1)
