"""The law of each effect against its formula, written out here once more."""

from itertools import pairwise

import numpy as np
import pytest
from numba import cfunc
from scipy.spatial.transform import Rotation

from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.dynamics.effects import compile_effects
from windwrench.dynamics.effects.base import LAW, ROTORS_SIZE, STATE_SIZE, VELOCITY
from windwrench.dynamics.effects.call import add_wrenches, deliver
from windwrench.dynamics.motion import body_record, effect_wrench

VEHICLE = load_vehicle("ardrone2")
PERIOD = 0.005
# a tilted vehicle that moves, turns and has four different rotors
R = Rotation.from_euler("zyx", [2.0, 0.2, -0.3]).as_matrix()
V, OMEGA = np.array([1.5, -0.7, 0.4]), np.array([0.5, -1.0, 2.0])
W = np.array([380.0, 400.0, 420.0, 410.0])


def wrench(vehicle, position=(0.0, 0.0, 0.15), wind=(0.0, 0.0, 0.0)):
    """Force (world) and torque (body) of a vehicle's effects in the state above."""
    bundle = compile_effects(vehicle)
    out = np.full(6, np.nan)
    effect_wrench(bundle.wrench_laws, bundle.wrench_coefficients, bundle.constants, body_record(bundle.vehicle)[0],
                  np.asarray(position, float), R, V, OMEGA, W, np.asarray(wind, float), 11.0, 0.0, np.empty(STATE_SIZE),
                  out)
    return out[:3], out[3:]


class Rotors:
    """A vehicle's rotor-input effects, called once a period."""

    def __init__(self, vehicle):
        self.bundle = compile_effects(vehicle)
        self.memory = np.zeros((len(self.bundle.rotor_laws), self.bundle.rotor_memory))

    def __call__(self, speeds, voltage=0.0, dt=PERIOD):
        rotors = np.zeros(ROTORS_SIZE)
        rotors[:4] = speeds
        deliver(self.bundle.rotor_laws, self.bundle.rotor_coefficients, self.bundle.constants, self.memory, dt, voltage,
                rotors)
        return rotors[:4]


def setting(name, **coefficients):
    return VEHICLE.with_effects(EffectSetting(name, coefficients))


@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.01, -0.02, 0.03)])
def test_rotor_drag_acts_at_each_rotor_in_its_plane(com):
    kd, wind = np.array([1.2e-4, 0.8e-4, 0.0]), np.array([0.5, 2.0, -0.3])
    vehicle = VEHICLE.with_effects(EffectSetting("com_offset", dict(zip(("cx", "cy", "cz"), com, strict=True))),
                                   EffectSetting("rotor_drag", {"kdx": kd[0], "kdy": kd[1]}))
    force, torque = np.zeros(3), np.zeros(3)
    for r, rate in zip(VEHICLE.positions, W, strict=True):
        F = -rate * kd * (R.T @ (V - wind) + np.cross(OMEGA, r))
        force, torque = force + R @ F, torque + np.cross(r - com, F)
    got = wrench(vehicle, wind=wind)
    np.testing.assert_allclose(got[0], force, rtol=1e-12)
    np.testing.assert_allclose(got[1], torque, rtol=1e-12, atol=1e-15)


def test_rotor_drag_does_nothing_to_a_vehicle_that_drifts_with_the_air():
    still = compile_effects(setting("rotor_drag", kdx=1e-4, kdy=1e-4))
    out = np.full(6, np.nan)
    effect_wrench(still.wrench_laws, still.wrench_coefficients, still.constants, body_record(VEHICLE)[0], np.zeros(3), R,
                  V, np.zeros(3), W, V, 0.0, 0.0, np.empty(STATE_SIZE), out)
    np.testing.assert_allclose(out, 0.0, atol=1e-15)


def test_ground_effect_lifts_each_rotor_by_its_own_height():
    rho, z = 3.0, 0.15
    force, torque = np.zeros(3), np.zeros(3)
    for r, rate, k in zip(VEHICLE.positions, W, VEHICLE.k, strict=True):
        height = z + (R @ r)[2]
        factor = 1 / (1 - rho * (VEHICLE.rotor_radius / (4 * height)) ** 2)
        F = np.array([0, 0, k * rate**2 * (factor - 1)])
        force, torque = force + R @ F, torque + np.cross(r, F)
    got = wrench(setting("ground_effect", rho=rho), (0.3, -0.2, z))
    np.testing.assert_allclose(got[0], force, rtol=1e-12)
    np.testing.assert_allclose(got[1], torque, rtol=1e-12, atol=1e-15)
    assert torque[0] != 0.0


def test_ground_effect_stays_finite_on_the_floor_and_fades_far_from_it():
    vehicle = setting("ground_effect", rho=3.0)
    thrust = float(np.sum(VEHICLE.k * W**2))
    on_the_floor = np.linalg.norm(wrench(vehicle, (0, 0, 0.0))[0])
    assert np.isfinite(on_the_floor)
    assert on_the_floor <= thrust * (1 + 1e-12)
    assert np.linalg.norm(wrench(vehicle, (0, 0, 3.0))[0]) < 1e-3 * thrust
    heights = [np.linalg.norm(wrench(vehicle, (0, 0, z))[0]) for z in (0.15, 0.2, 0.3, 0.5, 1.0)]
    assert all(low > high for low, high in pairwise(heights))


def test_motor_lag_is_the_exact_exponential():
    tau = 0.035
    rotors = Rotors(setting("motor_lag", tau=tau))
    np.testing.assert_array_equal(rotors([400.0] * 4), [400.0] * 4)  # starts at the first rates
    steps = np.array([rotors([500.0, 300.0, 400.0, 450.0]) for _ in range(20)])
    share = 1 - np.exp(-PERIOD * np.arange(1, 21) / tau)
    expected = 400.0 + share[:, None] * np.array([100.0, -100.0, 0.0, 50.0])
    np.testing.assert_allclose(steps, expected, rtol=1e-12)


def test_motor_lag_does_not_depend_on_how_a_time_is_cut_up():
    whole, halves = Rotors(setting("motor_lag", tau=0.04)), Rotors(setting("motor_lag", tau=0.04))
    for rotors in (whole, halves):
        rotors([400.0] * 4)
    halves([500.0] * 4, dt=0.002)
    np.testing.assert_allclose(halves([500.0] * 4, dt=0.008), whole([500.0] * 4, dt=0.010), rtol=1e-12)


def test_no_motor_lag_changes_nothing():
    rotors = Rotors(setting("motor_lag", tau=0.0))
    rotors([400.0] * 4)
    np.testing.assert_array_equal(rotors(W), W)


def test_battery_sag_takes_thrust_by_a_power_of_the_voltage():
    rotors = Rotors(setting("battery_sag", n=1.5))
    voltage = 10.2
    ratio = np.square(rotors(W, voltage) / W)
    np.testing.assert_allclose(ratio, (voltage / VEHICLE.voltage_ref) ** 1.5, rtol=1e-12)
    np.testing.assert_allclose(rotors(W, VEHICLE.voltage_ref), W, rtol=1e-15)
    np.testing.assert_array_equal(rotors(W, 0.0), W)  # voltage not known


def test_constant_force_stands_in_the_world_and_constant_torque_in_the_body():
    force, torque = wrench(VEHICLE.with_effects(EffectSetting("constant_force", {"fx": 0.1, "fz": -0.2}),
                                                EffectSetting("constant_torque", {"ty": 0.01})))
    np.testing.assert_array_equal(force, [0.1, 0.0, -0.2])
    np.testing.assert_array_equal(torque, [0.0, 0.01, 0.0])


def test_mass_and_centre_of_mass_change_the_body_and_nothing_else():
    vehicle = compile_effects(VEHICLE.with_effects(EffectSetting("mass", {"dm": 0.05}),
                                                   EffectSetting("com_offset", {"cx": 0.01}))).vehicle
    assert vehicle.mass == pytest.approx(VEHICLE.mass + 0.05)
    np.testing.assert_array_equal(vehicle.com, [0.01, 0, 0])
    np.testing.assert_array_equal(vehicle.inertia, VEHICLE.inertia)


def test_a_vehicle_cannot_lose_more_than_its_mass():
    with pytest.raises(InputError, match="dm"):
        compile_effects(setting("mass", dm=-1.0))


@cfunc(LAW)
def _users_law(c, vehicle, state, wrench):
    wrench[0] -= c[0] * state[VELOCITY]
    wrench[5] += c[1]


def test_a_user_s_own_law_is_called_by_its_address():
    state, out = np.zeros(STATE_SIZE), np.ones(6)
    state[VELOCITY] = 2.0
    coefficients = np.zeros((2, 8))
    coefficients[0, :2], coefficients[1, :2] = (0.5, 0.25), (0.0, 1.0)
    laws = np.array([_users_law.address, _users_law.address])
    add_wrenches(laws, coefficients, compile_effects(VEHICLE).constants, state, out)
    np.testing.assert_array_equal(out, [0.0, 1, 1, 1, 1, 2.25])
