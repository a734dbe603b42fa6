"""Vehicles as data: presets, the YAML form and its errors, rotor geometry and mixing."""

from dataclasses import fields, replace

import numpy as np
import pytest
import yaml
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.data_paths import data_file
from tests.support.outcomes import refused
from tests.support.vehicles import VEHICLE
from windwrench.dynamics import (
    EffectSetting,
    Mocap,
    dump_vehicle,
    load_vehicle,
    preset_names,
)
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.dynamics.vehicle_file import parse_vehicle, save_vehicle

GOOD = {
    "name": "mine",
    "mass": 0.5,
    "inertia": [0.002, 0.003, 0.004],
    "arm_l": 0.12,
    "k": [8e-6, 8.1e-6, 7.9e-6, 8e-6],
    "p": [2e-7, 2.1e-7, 1.9e-7, 2e-7],
}
WHOLE = """
name: "Möwe: 1"
inertia: [[0.002, 1.0e-4, 0], [1.0e-4, 0.003, 0], [0, 0, 0.004]]
com: [0.01, 0.0, -0.02]
rotor_positions: [[0.1, 0.12, 0.01], [-0.1, 0.12, 0], [-0.1, -0.12, 0], [0.1, -0.12, 0]]
spin: [1, -1, 1, -1]
omega_lsb: 2.5
omega_source: commanded
voltage_ref: 11.1
floor_z: -0.5
ceiling_z: 2.5
gravity: 9.8
rotor_radius: 0.11
mocap: {rate_hz: 100.0, sigma_pos_m: 0.002}
motor_curve: {thrust: [0.0, 0.02, 0.1], voltage_exponent: 2.0, command: [0.0, 65535.0]}
effects: [{name: rotor_drag, coefficients: {kdx: 1.0e-4, kdy: 2.0e-4}}]
"""


@pytest.mark.parametrize("name", preset_names())
def test_presets_load_can_hover_and_survive_dumping(name):
    vehicle = load_vehicle(name)
    assert vehicle.name == name
    wrench = vehicle.rotor_wrench(np.full(4, vehicle.hover_rate))
    assert_allclose(wrench, [vehicle.weight, 0, 0, 0], atol=1e-9)
    assert 1.5 * vehicle.hover_rate < vehicle.omega_max
    text = dump_vehicle(vehicle)
    assert dump_vehicle(parse_vehicle(text)) == text


def test_the_measured_flights_vehicle_loads():
    vehicle = load_vehicle(data_file("flights/vehicle.yaml"))
    assert vehicle.mass == 0.46
    assert vehicle.mocap.sigma_pos_m == 0.001  # the file says "nominal 0.001"
    assert vehicle.ceiling_z == 2.6
    assert_array_equal(np.sign(vehicle.mixing), np.sign(VEHICLE.mixing))


def test_a_saved_vehicle_is_the_vehicle_again(tmp_path):
    given = GOOD | yaml.safe_load(WHOLE)
    vehicle = parse_vehicle(yaml.safe_dump(given))
    curve = MotorCurve((0.0, 0.02, 0.1), 2.0, (0.0, 65535.0))
    assert vehicle.motor_curve == curve
    lifted = replace(vehicle, motor_curve=replace(curve, thrust=(0.01, 0.1)))
    assert_array_equal(
        lifted.commanded_thrust(np.array([[0.0, -0.1, 1e-9, 0.5]])) > 0.0, [[0, 0, 1, 1]]
    )
    for name, value in given.items():
        if name not in ("effects", "mocap", "motor_curve"):
            assert_array_equal(getattr(vehicle, name), value)
    assert vehicle.effects == (EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 2e-4}),)
    # numbers of numpy's own, and one of more digits than YAML's writer gives by itself
    drag = EffectSetting("rotor_drag", {"kdx": np.float64(1 / 3e5), "kdy": 2e-6})
    vehicle = replace(vehicle, mass=np.float64(0.0331)).with_effects(
        drag, EffectSetting("mass", {"dm": 0.001})
    )
    path = tmp_path / "new" / "vehicle.yaml"
    save_vehicle(vehicle, path)
    again = load_vehicle(path)
    assert again.effects == vehicle.effects
    for f in fields(vehicle):
        assert_array_equal(getattr(again, f.name), getattr(vehicle, f.name), f.name)
    assert [p.name for p in path.parent.iterdir()] == ["vehicle.yaml"]
    with refused(r"vehicle\.yaml.*cannot be written"):
        save_vehicle(vehicle, path / "vehicle.yaml")


def test_a_measured_vehicle_has_the_digits_that_are_known():
    vehicle = replace(
        VEHICLE,
        k=np.full(4, 8.0481234567e-6),
        mocap=Mocap(200.00000000000426, 0.0004993438472289853, 0.005072951427662196),
        effects=(EffectSetting("com_offset", {"cx": 0.0123456789, "cy": -0.000123456}),),
    )
    text = dump_vehicle(vehicle, {"com_offset": {"cx": 0.00034}})
    assert "    cx: 0.012346  # ± 0.00034\n    cy: -0.000123456\n" in text
    assert "- 8.048e-06\n" in text
    assert "rate_hz: 200.0\n  sigma_pos_m: 0.000499344\n" in text
    assert not {"gravity", "spin", "com", "omega_source"} & set(text.replace(":", " ").split())
    assert parse_vehicle(text).effects[0].coefficients["cx"] == 0.012346


def test_mixing_is_the_paper_s():
    k = np.array([8e-6, 8.2e-6, 7.9e-6, 8.1e-6])
    p = np.array([2e-7, 2.2e-7, 1.9e-7, 2.1e-7])
    vehicle = parse_vehicle(yaml.safe_dump({**GOOD, "k": k.tolist(), "p": p.tolist()}))
    assert_array_equal(vehicle.inertia, np.diag(GOOD["inertia"]))
    W = np.array([400.0, 410.0, 395.0, 420.0])
    c = k * W**2
    M = p * W**2
    arm = GOOD["arm_l"]
    expected = [
        c.sum(),  # (1)
        arm * (c[0] + c[1] - c[2] - c[3]),  # (8)
        arm * (-c[0] + c[1] + c[2] - c[3]),  # (9)
        M[0] - M[1] + M[2] - M[3],  # (10)
    ]
    assert_allclose(vehicle.rotor_wrench(W), expected, rtol=1e-12)
    assert_allclose(vehicle.rotor_wrench(np.stack([W, W]))[1], expected, rtol=1e-12)


def test_rotor_speeds_invert_the_rotor_wrench_and_clip_what_no_rotor_can_give():
    rng = default_rng(0)
    for W in rng.uniform(200, 600, (50, 4)):
        wrench = VEHICLE.rotor_wrench(W)
        assert_allclose(VEHICLE.rotor_speeds(wrench[0], wrench[1:]), W, rtol=1e-10)
    assert VEHICLE.rotor_speeds(1.0, np.array([0.5, 0.0, 0.0])).min() == 0.0
    assert VEHICLE.rotor_speeds(100.0, np.zeros(3)).max() == VEHICLE.omega_max
