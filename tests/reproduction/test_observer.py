"""The nonlinear observer: exact where it should be, unmoved by what carries no information."""

import numpy as np
import pytest
from numpy.linalg import norm
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal, assert_array_less
from scipy.spatial.transform import Rotation

from tests.support.flights import PERIOD, fly, yawing_flight
from tests.support.sizes import rms
from tests.support.vehicles import HOVER, POSE, VEHICLE
from windwrench import _core
from windwrench.dynamics import EffectSetting
from windwrench.reproduction import NonlinearObserver
from windwrench.reproduction.observer import OBSERVER

FORCE = np.array([0.3, -0.2, -0.1])  # of yawing_flight
TORQUE = np.array([0.0, 0.0, 0.02])


def loaded_hover(observer, steps, force, torque):
    """Hover tilted so that the rotors balance a force and a torque (world); return forces and
    torques (steps, 3).
    """
    lift = np.array([0.0, 0.0, VEHICLE.weight]) - force
    axis = np.cross([0.0, 0.0, 1.0], lift)
    sine = norm(axis) / norm(lift)
    attitude = Rotation.from_rotvec(axis / max(norm(axis), 1e-12) * np.arcsin(sine))
    rotors = VEHICLE.rotor_speeds(norm(lift), -attitude.inv().apply(torque))
    pose = [0, 0, 1], attitude.as_quat(scalar_first=True)
    observer.reset(*pose)
    estimates = [observer.step(rotors, *pose) for _ in range(steps)]
    return (
        np.array([e.force for e in estimates]),
        np.array([e.torque for e in estimates]),
        estimates[-1],
    )


def errors_along(flight, missing=()):
    """Return force, torque, position, velocity and body-rate errors (steps, 15)."""
    true = {"force": [FORCE], "torque": [TORQUE], "position": flight["true_x"][1:]}
    true |= {"velocity": flight["velocity"][1:], "angular_velocity": flight["omega"][1:]}
    found = fly(NonlinearObserver(VEHICLE), flight, missing)
    return np.hstack([np.array([getattr(e, n) for e in found]) - x for n, x in true.items()])


def test_the_record_of_python_is_the_memory_of_the_core():
    assert OBSERVER.itemsize == _core.OBSERVER_SIZE


def test_steady_state_is_exact_after_a_rise_of_a_second():
    force = np.array([0.4, -0.3, 0.5])
    torque = np.array([0.02, -0.01, 0.015])
    forces, torques, e = loaded_hover(NonlinearObserver(VEHICLE), 3000, force, torque)
    assert_allclose(forces[-1], force, atol=1e-9)
    assert_allclose(torques[-1], torque, atol=1e-9)
    assert_allclose(e.position, [0, 0, 1], atol=1e-9)
    assert_allclose(e.velocity, 0, atol=1e-9)
    assert_allclose(e.angular_velocity, 0, atol=1e-9)
    assert np.isnan(e.nis)
    for signal in (forces[:, 2], torques[:, 0], torques[:, 2]):
        rise = PERIOD * (
            np.argmax(signal > 0.9 * signal[-1]) - np.argmax(signal > 0.1 * signal[-1])
        )
        assert rise == pytest.approx(1.0, abs=0.02)


@pytest.fixture(scope="module")
def noisy_flight():
    return yawing_flight(VEHICLE, 2501, seed=2, substeps=3)


def test_a_yawing_flight_is_no_wrench(noisy_flight):
    flight = yawing_flight(VEHICLE, 2501, sigma_position=0.0, sigma_attitude=0.0, substeps=6)
    clean = errors_along(flight)[1200:]
    bounds = np.repeat([2e-3, 5e-5, 1e-3, 1e-3], 3)
    assert_array_less(abs(clean[:, :12]).max(axis=0), bounds)
    errors = errors_along(noisy_flight)
    noisy = rms(errors[1200:], axis=0)
    assert_array_less(noisy[:12], np.repeat([6e-3, 0.6e-3, 1e-3, 0.01], 3))
    signs = default_rng(0).choice([-1.0, 1.0], 2501)
    flipped = noisy_flight | {"quaternion": signs[:, None] * noisy_flight["quaternion"]}
    assert_array_equal(errors_along(flipped), errors)


def test_missing_measurements_leave_the_wrench_where_it_was(noisy_flight):
    random = set(default_rng(3).choice(2501, 1250, replace=False))
    errors = errors_along(noisy_flight, random)[1200:]
    assert rms(errors[:, :3]) < 8e-3
    assert rms(errors[:, 3:6]) < 1e-3
    # half a second blind, then the pose again
    errors = errors_along(noisy_flight, range(1500, 1600))
    assert abs(errors[1499:1598, :3] - errors[1498, :3]).max() < 1e-12
    assert abs(errors[1499:1598, 6:9]).max() < 0.05
    assert abs(errors[1599:, :3]).max() < 0.15
    assert abs(errors[1599:, 3:6]).max() < 5e-3
    assert abs(errors[-100:, :3]).max() < 0.03


def test_declared_effects_are_not_a_wrench():
    drag = EffectSetting("rotor_drag", {"kdx": 3e-4, "kdy": 3e-4})
    offset = EffectSetting("com_offset", {"cx": 0.01, "cy": -0.006, "cz": 0.0})
    force = {}
    for vehicle in (VEHICLE, VEHICLE.with_effects(drag, offset)):
        observer = NonlinearObserver(vehicle)
        observer.reset(*POSE, None, [1.0, 0, 0])
        for k in range(1, 2001):
            e = observer.step(HOVER, [k * PERIOD, 0, 1], [1, 0, 0, 0])
        force[vehicle is VEHICLE] = np.concatenate([e.force, e.torque])
    pull = 3e-4 * 4 * VEHICLE.hover_rate
    torque = VEHICLE.weight * np.array([-0.006, -0.01])
    assert_allclose(force[True], 0.0, atol=1e-6)
    # the wrench that cancels drag and the offset thrust in a steady translation
    assert_allclose(force[False][0], pull, rtol=1e-6)
    assert_allclose(abs(force[False][3:5]), np.abs(torque), rtol=1e-6)
