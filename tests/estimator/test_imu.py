"""Inertial measurements in the wrench filter."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from numpy.linalg import eigvalsh, inv, solve
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.flights import PERIOD
from tests.support.model_flights import simulate_model
from tests.support.outcomes import refused
from tests.support.reference_filters import KIT_ORDER
from tests.support.vehicles import HOVER, POSE, VEHICLE
from windwrench import _core
from windwrench.dynamics import EffectSetting
from windwrench.estimator import UKFTuning, WrenchUKF
from windwrench.estimator.consistency import chi2_band, state_error
from windwrench.estimator.reference import displaced


def test_a_declared_effect_is_in_what_the_accelerometer_should_read():
    declared = VEHICLE.with_effects(EffectSetting("constant_force", {"fx": 0.5}))
    ukf = WrenchUKF(declared, UKFTuning(), PERIOD)
    ukf.reset(*POSE)
    ukf.step(HOVER)
    e = ukf.correct_imu(accelerometer=[0.5 / VEHICLE.mass, 0.0, VEHICLE.gravity])
    assert e.nis < 1e-6


def drawn(steps, dt=0.005, seed=0, tuning=None, vehicle=VEHICLE, **settings):
    tuning = tuning or UKFTuning.for_vehicle(vehicle, dt)
    hover = np.full((steps, 4), vehicle.hover_rate)
    return simulate_model(vehicle, tuning, hover, dt, seed=seed, **settings)


def started(flight, tuning=None, period=0.005, vehicle=VEHICLE, gate=None):
    f = WrenchUKF(vehicle, tuning or UKFTuning.for_vehicle(vehicle, period), period, gate)
    flight.begin(f)
    return f


def fly(f, flight, steps, dt=None, every=4, first="imu", after=0):
    """Run a filter over steps of a flight, with a pose at each ``every``-th; return it."""
    for k in range(after, after + steps):
        f.predict(flight.rotor_speeds[k], dt)
        pose = (k + 1) % every == 0
        if pose and first == "pose":
            f.correct(flight.measured_position[k], flight.measured_quaternion[k])
        f.correct_imu(flight.gyro[k], flight.accelerometer[k])
        if pose and first == "imu":
            f.correct(flight.measured_position[k], flight.measured_quaternion[k])
    return f


def error_of(f, state, gyro_bias, accelerometer_bias):
    """The error (24,) of a filter with its biases against a state (20,) and biases (3,)."""
    biases = gyro_bias - f.gyro_bias, accelerometer_bias - f.accelerometer_bias
    return np.concatenate([state_error(f.estimate, state), *biases])


OFFSET = replace(VEHICLE, com=np.array([0.02, -0.015, 0.01]))


@pytest.mark.parametrize("vehicle", [VEHICLE, OFFSET], ids=["centred", "offset"])
def test_the_noise_of_a_step_is_in_its_velocity_and_in_its_specific_force(vehicle):
    """With x' = F x + G w and z = h(x') + D w + v: P_xz = P H' + G Q D', S = H P H' + H G Q D' +
    D Q G' H' + D Q D' + R, and biases beside it.
    """
    period = 0.002
    flight = drawn(41, period, vehicle=vehicle, velocity=(1.0, 0.0, 0.0))
    tuning = UKFTuning.for_vehicle(vehicle, period)
    f = fly(started(flight, tuning, period, vehicle), flight, 40)
    f.predict(flight.rotor_speeds[40])
    P = f.covariance_with_biases
    x = f.estimate.state
    b = np.concatenate([f.gyro_bias, f.accelerometer_bias])
    z = np.concatenate([flight.gyro[40], flight.accelerometer[40]])

    # h and its Jacobian by the error state, from the filter's own model, at the estimate
    record, address = f.record[0], f.record.ctypes.data
    point = np.zeros(20)
    start = x[KIT_ORDER]

    def expected_at(error):
        out = np.zeros(6)
        point[KIT_ORDER] = displaced(start, error)
        _core.expected_imu(address, point, out)
        return out

    slopes = [(expected_at(e) - expected_at(-e)) / 2e-6 for e in 1e-6 * np.eye(18)]
    H = np.vstack([*slopes, np.eye(6)]).T
    # the noise of a step: torque n_m and thrust n_c in body axes, through centre of mass and mass
    alpha = tuning.motor_torque_noise * inv(vehicle.inertia)
    push = tuning.thrust_noise / vehicle.mass * np.eye(3)
    felt = np.hstack([np.cross(vehicle.com, alpha.T).T, push])
    moved = period * record["centre_rotation"] @ felt
    none = np.zeros((3, 6))
    turned = np.hstack([period * alpha, np.zeros((3, 3))])
    GQ = np.vstack([none, turned, period / 2 * moved, moved, np.zeros((12, 6))])
    DQ = np.vstack([none, felt])
    noise = np.repeat([tuning.gyro_noise**2, tuning.accelerometer_noise**2], 3)
    cross = P @ H.T + GQ @ DQ.T
    S = H @ cross + DQ @ (H @ GQ + DQ).T + np.diag(noise)
    innovation = z - expected_at(np.zeros(18)) - b
    expected = cross @ solve(S, innovation)

    after = f.correct_imu(flight.gyro[40], flight.accelerometer[40])
    deviation = np.sqrt(np.diagonal(P))
    step = -error_of(f, x, b[:3], b[3:])
    assert np.max(abs(step - expected) / deviation) < 2e-3
    assert np.max(np.abs(expected) / deviation) > 0.1
    left = P - cross @ solve(S, cross.T)
    scale = np.sqrt(np.outer(np.diagonal(left), np.diagonal(left)))
    assert np.max(abs(f.covariance_with_biases - left) / scale) < 5e-3
    assert after.nis == pytest.approx(innovation @ solve(S, innovation), rel=2e-3)


def test_pose_and_imu_of_one_moment_may_come_in_either_order():
    flight = drawn(80)
    one = fly(started(flight), flight, 80)
    other = fly(started(flight), flight, 80, first="pose")
    apart = started(flight)
    for k in range(80):
        apart.predict(flight.rotor_speeds[k])
        apart.correct_imu(None, flight.accelerometer[k])
        if (k + 1) % 4 == 0:
            apart.correct(flight.measured_position[k], flight.measured_quaternion[k])
        apart.correct_imu(flight.gyro[k], None)
    deviation = np.sqrt(np.diagonal(one.covariance_with_biases))
    for f in (other, apart):
        difference = error_of(one, f.estimate.state, f.gyro_bias, f.accelerometer_bias)
        assert np.max(np.abs(difference) / deviation) < 0.02


def consistency(vehicle, rate, pose_hz, fine, runs, seconds, memory):
    """Return mean IMU-NIS (6), force-NEES (3), NEES (18) and NEES with biases (24), and the bands
    of one step's mean over the runs. ``fine`` steps make a period of the filter; ``memory``, s, is
    that of gusts.
    """
    dt = 1.0 / rate
    tuning, drawn_with = (
        replace(UKFTuning.for_vehicle(vehicle, period), force_time=memory, torque_time=0.5 * memory)
        for period in (dt * fine, dt)
    )
    steps = round(seconds * rate)
    every = rate // pose_hz
    found = np.empty((4, runs, steps))
    for r in range(runs):
        flight = drawn(steps, dt, r, drawn_with, vehicle, angular_velocity=(0.0, 0.0, 1.0))
        f = started(flight, tuning, dt * fine, vehicle)
        for k in range(steps):
            fly(f, flight, 1, dt, every=steps + 1, after=k)
            nis = f.estimate.nis
            if (k + 1) % every == 0:
                f.correct(flight.measured_position[k], flight.measured_quaternion[k])
            P = f.covariance_with_biases
            error = error_of(f, flight.state[k], flight.gyro_bias[k], flight.accelerometer_bias[k])
            found[0, r, k] = nis
            for i, rows in ((1, slice(15, 18)), (2, slice(0, 18)), (3, slice(0, 24))):
                found[i, r, k] = error[rows] @ solve(P[rows, rows], error[rows])
    return found.mean(axis=(1, 2)), [chi2_band(dof, runs) for dof in (6, 3, 18, 24)]


RATES = [(200, 50, 1), (500, 50, 1), (1000, 50, 1), (1000, 100, 10)]


@pytest.mark.parametrize(
    ("vehicle", "rate", "pose_hz", "fine", "runs", "seconds", "memory"),
    [
        (OFFSET, 500, 50, 5, 25, 0.6, 0.1),
        *(pytest.param(VEHICLE, *rates, 100, 2.0, inf, marks=pytest.mark.slow) for rates in RATES),
    ],
)
def test_the_filter_with_an_imu_is_consistent(vehicle, rate, pose_hz, fine, runs, seconds, memory):
    """Off the centre of mass the torque's noise is in the specific force; the last rates predict in
    tenths of the period for which the tuning is stated.
    """
    mean, bands = consistency(vehicle, rate, pose_hz, fine, runs, seconds, memory)
    for value, (low, high) in zip(mean, bands, strict=True):
        assert low <= value <= high
    # innovations are independent from step to step, so all of them have a narrow band
    low, high = chi2_band(6, runs * round(seconds * rate), 0.999)
    assert low <= mean[0] <= high


def test_biases_are_found_and_cost_nothing():
    """The filter of the first day had 0.03 N of 0.02 rad/s and 0.1 m/s2."""
    tuning = replace(
        UKFTuning(), thrust_noise=0.03, motor_torque_noise=0.003, force_walk=1e-3, torque_walk=1e-4
    )
    known = replace(tuning, gyro_bias_std=1e-9, accelerometer_bias_std=1e-9)
    flight = drawn(1200, tuning=replace(known, gyro_bias_walk=1e-9, accelerometer_bias_walk=1e-9))
    turn = np.array([0.0, 0.02, 0.0])
    biased = replace(flight, gyro=flight.gyro + turn, accelerometer=flight.accelerometer - 0.1)
    f, g = (fly(started(each, tuning), each, 1200) for each in (biased, flight))
    assert (abs(f.gyro_bias - turn) < 4 * f.gyro_bias_std).all()
    assert (abs(f.accelerometer_bias + 0.1) < 4 * f.accelerometer_bias_std).all()
    assert (f.gyro_bias_std < 0.002).all()
    assert (f.accelerometer_bias_std < 0.02).all()
    assert_allclose(f.estimate.force, g.estimate.force, atol=0.003)


@pytest.mark.parametrize("posed", [True, False])
def test_the_first_gyro_sample_has_a_bias_whenever_it_comes(posed):
    """A rate is known no better than the bias of the gyro, whether or not a pose came before."""
    f = WrenchUKF(VEHICLE, UKFTuning(gyro_noise=0.005, gyro_bias_std=0.1), PERIOD)
    f.reset(*POSE)
    f.step(HOVER, *(POSE if posed else (None, None)))
    e = f.correct_imu(np.zeros(3), None)
    assert (np.sqrt(np.diag(e.covariance)[3:6]) > 0.09).all()


def test_an_accelerometer_says_nothing_while_the_rotors_are_unknown():
    for flown in (False, True):
        f = WrenchUKF(VEHICLE)
        f.reset(*POSE)
        if flown:  # another flight, whose rotors are no longer those that turn
            f.step(HOVER, *POSE)
            f.correct_imu(np.zeros(3), [0, 0, VEHICLE.gravity])
            f.reset(*POSE)
        P = f.covariance
        e = f.correct_imu(accelerometer=[0.0, 0.0, VEHICLE.gravity])
        assert np.isnan(e.nis)
        assert_array_equal(e.force, 0.0)
        assert_array_equal(f.covariance, P)
        e = f.correct_imu(np.zeros(3), [0.0, 0.0, 30.0])
        assert e.nis == 0.0  # of the gyro
        assert e.covariance[3, 3] < P[3, 3]
        assert_array_equal(e.force, 0.0)
        # from the first step on it does
        f.predict(HOVER)
        e = f.correct_imu(accelerometer=[0.0, 0.0, VEHICLE.gravity + 0.1])
        assert e.force[2] > 0.001


def test_a_filter_that_never_sees_an_imu_keeps_its_bits():
    flight = drawn(50)
    f = started(flight)
    g = fly(started(flight), flight, 5)
    flight.begin(g)
    for k in range(50):
        speeds = flight.rotor_speeds[k]
        x = flight.measured_position[k]
        q = flight.measured_quaternion[k]
        one = f.step(speeds, x, q)
        other = g.step(speeds, x, q)
        # nor do biases that nothing measures change the pose's part
        assert_array_equal(one.state, other.state)
        assert_array_equal(one.covariance, other.covariance)
    assert f.covariance.shape == (18, 18)
    assert_array_equal(f.gyro_bias, 0.0)
    assert_allclose(f.gyro_bias_std, UKFTuning().gyro_bias_std)
    assert isinstance(f.step_address, int)
    with refused("IMU"):
        _ = g.step_address


@pytest.mark.parametrize("begun", ["by a reset", "by a restart"])
def test_a_flight_that_begins_anew_has_the_prior_of_the_biases(begun):
    flight = drawn(100)
    f = fly(started(flight), flight, 100)
    assert (f.gyro_bias_std < 0.1).all()
    if begun == "by a reset":
        f.reset(*POSE)
        assert f.imu_refused == 0
    else:
        estimate = f.correct([50.0, 0.0, 1.0], flight.measured_quaternion[-1])
        assert (estimate.status, estimate.restarts) == ("restarted", 1)
    assert_array_equal(np.concatenate([f.gyro_bias, f.accelerometer_bias]), 0.0)
    assert_allclose(f.gyro_bias_std, 0.1)
    assert_allclose(f.accelerometer_bias_std, 0.2)
    assert_array_equal(f.covariance_with_biases[:18, 18:], 0.0)


@pytest.mark.parametrize(
    ("shaking", "constant"), [(30.0, 0.0), (0.0, 157.0)], ids=["vibration", "saturation"]
)
def test_the_gate_keeps_faults_of_an_imu_out(shaking, constant):
    flight = drawn(500)
    bad = flight.accelerometer.copy()
    count = slice(200, 300)  # 0.5 s
    bad[count] += shaking * default_rng(1).standard_normal((100, 3))
    bad[count, 0] += constant
    spoiled = replace(flight, accelerometer=bad)
    gated = started(flight, gate=0.999)
    open_ = started(flight)
    clean = started(flight)
    errors = []
    for f, seen in ((gated, spoiled), (open_, spoiled), (clean, flight)):
        worst = 0.0
        for k in range(500):
            fly(f, seen, 1, after=k)
            if k >= 200:
                worst = max(worst, abs(f.estimate.force - flight.force[k]).max())
        errors.append(worst)
    assert gated.imu_refused > 90
    assert open_.imu_refused == 0
    assert errors[0] < 2.0 * errors[2]
    assert errors[1] > 5.0 * errors[2]
    deviation = np.sqrt(np.diagonal(gated.covariance)[15:18])
    assert (abs(gated.estimate.force - flight.force[-1]) < 5 * deviation).all()


def test_a_gate_leaves_the_gyro_in_where_the_accelerometer_saturates():
    flight = drawn(60)
    f, g = (fly(started(flight, gate=gate), flight, 59) for gate in (0.999, None))
    for h in (f, g):
        h.predict(flight.rotor_speeds[59])
    e = f.correct_imu(flight.gyro[59], [157.0, 157.0, 157.0])
    expected = g.correct_imu(flight.gyro[59])
    assert e.nis > 1000
    assert f.imu_refused == 1
    assert_allclose(e.state[:19], expected.state[:19], atol=1e-9)


def hovering(gate=None):
    """A filter after one step of hover."""
    f = WrenchUKF(VEHICLE, UKFTuning(), PERIOD, gate)
    f.reset(*POSE)
    f.predict(HOVER)
    return f


@pytest.mark.parametrize("likelier", [0, 1])
def test_of_two_sensors_that_are_unlikely_together_alone_the_likelier_counts(likelier):
    """Gates of 0.999: 16.3 for one sensor, 22.5 for both."""
    expected = np.array([[0.0] * 3, [0.0, 0.0, 9.81]])
    off = np.eye(3)[0]
    wanted = [15.0, 15.0]
    read = expected.copy()
    wanted[likelier] = 9.0
    for sensor in (0, 1):
        alone = [None, None]
        alone[sensor] = expected[sensor] + off
        size = np.sqrt(wanted[sensor] / hovering().correct_imu(*alone).nis)
        read[sensor] = expected[sensor] + size * off
    f = hovering(0.999)
    g = hovering()
    both = f.correct_imu(*read)
    one = g.correct_imu(*(read[0], None) if likelier == 0 else (None, read[1]))
    assert (f.imu_refused, both.nis > 22.5) == (1, True)
    assert_allclose(both.state[:19], one.state[:19], atol=1e-12)


def test_a_push_is_believed_although_it_is_unlikely():
    """Five samples that agree are no vibration, and two weights are no saturated sensor."""
    push = np.zeros((400, 6))
    push[200, 3] = 6.0
    flight = drawn(400, push=push)
    f, g = (fly(started(flight, gate=gate), flight, 230) for gate in (0.999, None))
    assert 0 < f.imu_refused < 15
    for h in (f, g):
        fly(h, flight, 170, after=230)
    assert abs(f.estimate.force[0] - g.estimate.force[0]) < 0.1 * 6.0


def test_a_bias_that_jumps_is_found_again_through_the_gate():
    tuning = UKFTuning(thrust_noise=0.03, motor_torque_noise=0.002, torque_walk=1e-5)
    flight = drawn(1200, tuning=tuning)
    gyro = flight.gyro.copy()
    gyro[400:, 1] += 0.25
    f = fly(started(flight, tuning, gate=0.999), replace(flight, gyro=gyro), 1200)
    assert f.imu_refused > 50
    assert abs(f.gyro_bias[1] - flight.gyro_bias[-1, 1] - 0.25) < 5 * f.gyro_bias_std[1]
    assert f.gyro_bias_std[1] < 0.02


def test_whatever_an_imu_says_numbers_stay_finite():
    rng = default_rng(0)
    for gate in (None, 0.999):
        f = WrenchUKF(VEHICLE, gate=gate)
        f.reset(*POSE)
        for k in range(300):
            f.predict(HOVER, float(rng.choice([1e-3, 5e-3, 0.02])))
            size = 10.0 ** rng.uniform(-3, 200)
            f.correct_imu(size * rng.standard_normal(3), size * rng.standard_normal(3))
            if k % 3 == 0:
                f.correct(*POSE)
            J = f.covariance_with_biases
            assert np.isfinite(J).all()
            scale = 1.0 / np.sqrt(np.diagonal(J))
            assert eigvalsh(J * np.outer(scale, scale))[0] > 0
            assert np.isfinite(f.estimate.state[:19]).all()
            assert np.isfinite(f.accelerometer_bias).all()
