"""The nonlinear observer: exact where it should be, unmoved by what carries no information."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.flights import PERIOD, yawing_flight
from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.dynamics.rotation import matrix_of
from windwrench.estimator import UKFTuning
from windwrench.estimator.consistency import simulate_model
from windwrench.estimator.observer import NonlinearObserver, ObserverTuning

VEHICLE = load_vehicle("ardrone2")
FORCE, TORQUE = np.array([0.3, -0.2, -0.1]), np.array([0.0, 0.0, 0.02])  # of yawing_flight
STILL = UKFTuning(
    motor_torque_noise=1e-12,
    torque_walk=1e-12,
    thrust_noise=1e-12,
    force_walk=1e-12,
    position_noise=1e-12,
    attitude_noise=1e-12,
)


def loaded_hover(observer, steps, force, torque, sigma_position=0.0, sigma_attitude=0.0, seed=0):
    """Hover tilted so that the rotors balance a force and a torque (world); return forces and
    torques (steps, 3).
    """
    rng = np.random.default_rng(seed)
    lift = np.array([0.0, 0.0, VEHICLE.weight]) - force
    axis = np.cross([0.0, 0.0, 1.0], lift)
    sine = np.linalg.norm(axis) / np.linalg.norm(lift)
    attitude = Rotation.from_rotvec(axis / max(np.linalg.norm(axis), 1e-12) * np.arcsin(sine))
    rotors = VEHICLE.rotor_speeds(np.linalg.norm(lift), -attitude.inv().apply(torque))
    observer.reset([0, 0, 1], attitude.as_quat(scalar_first=True))
    out = np.empty((steps, 6))
    for k in range(steps):
        noise = Rotation.from_rotvec(sigma_attitude * rng.standard_normal(3))
        e = observer.step(
            rotors,
            [0, 0, 1] + sigma_position * rng.standard_normal(3),
            (noise * attitude).as_quat(scalar_first=True),
        )
        out[k] = *e.force, *e.torque
    return out[:, :3], out[:, 3:], e


def fly(observer, flight, missing=(), signs=None, start=0):
    """Return force, torque, position, velocity and body-rate errors (steps, 15)."""
    observer.reset(
        flight["true_x"][start],
        flight["true_q"][start],
        None,
        flight["velocity"][start],
        flight["omega"][start],
    )
    out = []
    for k in range(start + 1, len(flight["rotors"])):
        q = flight["quaternion"][k] * (1.0 if signs is None else signs[k])
        e = observer.step(
            flight["rotors"][k], *(() if k in missing else (flight["position"][k], q))
        )
        out.append(
            np.concatenate(
                [
                    e.force - FORCE,
                    e.torque - TORQUE,
                    e.position - flight["true_x"][k],
                    e.velocity - flight["velocity"][k],
                    e.angular_velocity - flight["omega"][k],
                ]
            )
        )
    return np.array(out)


def test_steady_state_is_exact():
    force, torque = np.array([0.4, -0.3, 0.5]), np.array([0.02, -0.01, 0.015])
    forces, torques, e = loaded_hover(NonlinearObserver(VEHICLE), 3000, force, torque)
    assert np.allclose(forces[-1], force, atol=1e-9)
    assert np.allclose(torques[-1], torque, atol=1e-9)
    assert np.allclose(e.position, [0, 0, 1], atol=1e-9)
    assert np.allclose(e.velocity, 0, atol=1e-9)
    assert np.allclose(e.angular_velocity, 0, atol=1e-9)
    assert np.isnan(e.nis)
    assert np.linalg.eigvalsh(e.covariance)[0] > 0


def test_the_covariance_is_that_of_the_error_in_steady_flight():
    """Force, torque and pose of 20 flights in the filter's own noise, against what it says."""
    from windwrench.estimator.consistency import state_error

    errors = []
    for seed in range(20):
        run = simulate_model(
            VEHICLE, UKFTuning(), np.full((1500, 4), VEHICLE.hover_rate), seed=seed
        )
        observer = NonlinearObserver(VEHICLE)
        observer.reset(run.initial_position, run.initial_quaternion)
        for k in range(1500):
            e = observer.step(
                run.rotor_speeds[k], run.measured_position[k], run.measured_quaternion[k]
            )
            if k % 250 == 249 and k > 500:
                errors.append(state_error(e, *run.truth(k)))
    ratio = np.mean(np.square(errors), axis=0) / np.diag(e.covariance)
    # 80 correlated samples each; the mean over three axes of a part scatters by about 15 %
    parts = ratio.reshape(6, 3).mean(axis=1)
    np.testing.assert_array_less(parts, 1.6)
    np.testing.assert_array_less(0.6, parts)


def test_rise_time_is_a_second():
    force, torque = np.array([0.0, 0.0, 0.5]), np.array([0.02, 0.0, 0.01])
    forces, torques, _ = loaded_hover(NonlinearObserver(VEHICLE), 3000, force, torque)
    for signal in (forces[:, 2], torques[:, 0], torques[:, 2]):
        rise = PERIOD * (
            np.argmax(signal > 0.9 * signal[-1]) - np.argmax(signal > 0.1 * signal[-1])
        )
        assert rise == pytest.approx(1.0, abs=0.02)


def test_the_error_decays_exponentially_at_the_gain():
    observer = NonlinearObserver(
        VEHICLE, ObserverTuning(force_gain=(1.0, 2.0, 4.0), position_cutoff_hz=1000.0)
    )
    forces, _, _ = loaded_hover(observer, 400, np.array([0, 0, 0.5]), np.zeros(3))
    t = PERIOD * np.arange(1, 401)
    assert np.allclose(forces[:, 2], 0.5 * (1.0 - np.exp(-4.0 * t)), atol=2e-3)


def test_noise_at_hover():
    forces, torques, _ = loaded_hover(
        NonlinearObserver(VEHICLE),
        3000,
        np.array([0, 0, 0.3]),
        np.array([0, 0, 0.01]),
        0.001,
        0.005,
    )
    assert np.all(forces[1500:].std(axis=0) < 6e-3)
    assert np.all(torques[1500:].std(axis=0) < 0.6e-3)


@pytest.mark.parametrize("cutoff", [0.5, 10.0, 100.0, 1e3, 2e4])
def test_any_cutoff_is_stable_and_unbiased_in_motion(cutoff):
    tuning = ObserverTuning(position_cutoff_hz=cutoff, attitude_cutoff_hz=cutoff)
    observer = NonlinearObserver(VEHICLE, tuning)
    observer.reset([0, 0, 1], [1, 0, 0, 0], None, [1.0, -0.5, 0.2], [0, 0, 2.0])
    hover = np.full(4, VEHICLE.hover_rate)
    for k in range(1, 2001):
        t = k * PERIOD
        e = observer.step(hover, [t, -0.5 * t, 1 + 0.2 * t], [np.cos(t), 0, 0, np.sin(t)])
    assert np.allclose(e.velocity, [1.0, -0.5, 0.2], atol=1e-8)
    assert np.allclose(e.angular_velocity, [0, 0, 2.0], atol=1e-3)
    assert np.allclose(e.position, [t, -0.5 * t, 1 + 0.2 * t], atol=1e-7)
    assert np.allclose(e.force, 0, atol=1e-8)
    assert np.allclose(e.torque, 0, atol=1e-6)


def test_a_yawing_flight_is_no_wrench():
    flight = yawing_flight(VEHICLE, 2501, sigma_position=0.0, sigma_attitude=0.0, substeps=6)
    clean = fly(NonlinearObserver(VEHICLE), flight)[1200:]
    assert np.abs(clean[:, :3]).max() < 2e-3
    assert np.abs(clean[:, 3:6]).max() < 5e-5
    assert np.abs(clean[:, 6:9]).max() < 1e-3
    assert np.abs(clean[:, 9:12]).max() < 1e-3
    errors = fly(NonlinearObserver(VEHICLE), yawing_flight(VEHICLE, 2501, seed=2, substeps=3))[
        1200:
    ]
    noisy = np.sqrt(np.mean(errors**2, axis=0))
    assert np.all(noisy[:3] < 6e-3)
    assert np.all(noisy[3:6] < 0.6e-3)
    assert np.all(noisy[6:9] < 1e-3)
    assert np.all(noisy[9:12] < 0.01)


def test_the_sign_of_a_quaternion_means_nothing():
    flight = yawing_flight(VEHICLE, 601)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], 601)
    assert np.array_equal(
        fly(NonlinearObserver(VEHICLE), flight),
        fly(NonlinearObserver(VEHICLE), flight, signs=signs),
    )


def test_missing_measurements_leave_the_wrench_where_it_was():
    flight = yawing_flight(VEHICLE, 2501, seed=1, substeps=3)
    random = set(np.random.default_rng(3).choice(2501, 1250, replace=False))
    errors = fly(NonlinearObserver(VEHICLE), flight, missing=random)[1200:]
    assert np.sqrt(np.mean(errors[:, :3] ** 2)) < 8e-3
    assert np.sqrt(np.mean(errors[:, 3:6] ** 2)) < 1e-3
    # half a second blind, then the pose again
    errors = fly(NonlinearObserver(VEHICLE), flight, missing=range(1500, 1600))
    assert np.abs(errors[1499:1598, :3] - errors[1498, :3]).max() < 1e-12
    assert np.abs(errors[1499:1598, 6:9]).max() < 0.05
    assert np.abs(errors[1599:, :3]).max() < 0.15
    assert np.abs(errors[1599:, 3:6]).max() < 5e-3
    assert np.abs(errors[-100:, :3]).max() < 0.03


def test_a_part_of_a_pose_is_enough_for_its_part_of_the_wrench():
    flight = yawing_flight(VEHICLE, 1201, seed=1, substeps=3)
    observer = NonlinearObserver(VEHICLE)
    observer.reset(
        flight["true_x"][0], flight["true_q"][0], None, flight["velocity"][0], flight["omega"][0]
    )
    for k in range(1, 1201):
        e = observer.step(flight["rotors"][k], None, flight["quaternion"][k])
    assert np.allclose(e.torque, TORQUE, atol=2e-3)
    assert np.all(e.force == 0)


def test_declared_effects_are_not_a_wrench():
    vehicle = VEHICLE.with_effects(
        EffectSetting("com_offset", {"cx": 0.01, "cy": -0.006, "cz": 0.02}),
        EffectSetting("rotor_drag", {"kdx": 1.5e-4, "kdy": 1.5e-4}),
        EffectSetting("motor_lag", {"tau": 0.03}),
    )
    swing = 20.0 * np.sin(np.arange(1000)[:, None] * [0.011, 0.017, 0.013, 0.019])
    run = simulate_model(
        vehicle,
        STILL,
        VEHICLE.hover_rate + swing,
        quaternion=(0.5, 0, 0, 0.75**0.5),
        angular_velocity=(0, 0, 1.5),
        covariance=1e-20 * np.eye(18),
    )

    def worst(declared):
        observer = NonlinearObserver(declared)
        observer.reset(
            run.initial_position,
            run.initial_quaternion,
            None,
            run.initial_velocity,
            run.initial_angular_velocity,
        )
        estimates = [
            observer.step(*sample)
            for sample in zip(
                run.rotor_speeds, run.measured_position, run.measured_quaternion, strict=True
            )
        ]
        return (
            max(np.abs(e.force).max() for e in estimates),
            max(np.abs(e.torque).max() for e in estimates),
            np.abs(estimates[-1].velocity - run.velocity[-1]).max(),
        )

    force, torque, velocity = worst(vehicle)
    assert force < 0.02
    assert torque < 1e-3
    assert velocity < 0.01
    force, torque, _ = worst(VEHICLE)
    assert force > 0.3
    assert torque > 0.02


def test_estimates_are_not_changed_by_later_steps():
    observer = NonlinearObserver(VEHICLE)
    observer.reset([0, 0, 1], [1, 0, 0, 0])
    first = observer.step(np.full(4, 400.0), [0, 0, 1], [1, 0, 0, 0])
    kept = first.state.copy()
    observer.step(np.full(4, 300.0), [0, 0.1, 1], [1, 0, 0, 0])
    assert np.array_equal(first.state, kept, equal_nan=True)
    assert np.allclose(
        matrix_of(observer.estimate.quaternion) @ matrix_of(observer.estimate.quaternion).T,
        np.eye(3),
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ObserverTuning(force_gain=-1.0), "force_gain"),
        (lambda: ObserverTuning(torque_gain=(1.0, 2.0)), "torque_gain"),
        (lambda: ObserverTuning(position_cutoff_hz=np.nan), "position_cutoff_hz"),
        (lambda: ObserverTuning(attitude_cutoff_hz=(1.0, 2.0, 3.0)), "attitude_cutoff_hz"),
        (lambda: NonlinearObserver(VEHICLE, period=0.0), "period"),
        (lambda: NonlinearObserver(VEHICLE).reset([0, 0], [1, 0, 0, 0]), "position"),
        (lambda: NonlinearObserver(VEHICLE).step([1, 2, 3]), "rotor_speeds"),
        (
            lambda: NonlinearObserver(VEHICLE).step([1, 2, 3, 4], [0, 0, 1], [2, 0, 0, 0]),
            "quaternion",
        ),
    ],
)
def test_bad_input_is_named(make, words):
    with pytest.raises(InputError, match=words):
        make()
