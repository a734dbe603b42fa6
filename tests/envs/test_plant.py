"""The plant against the mechanics of a rigid body, and its sensing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.linalg import eigvalsh, norm
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from tests.support.sizes import rms
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.envs.closed_loop import ClosedLoop
from windwrench.envs.plant import NOISE, SUBSTEPS, TICK, PlantSettings
from windwrench.envs.recording import TRAJECTORIES, record_flight

QUIET = PlantSettings(
    disturbance_force=0.0, disturbance_torque=0.0, motor_lag=0.0, sensor_noise=False
)
VEHICLE = replace(load_vehicle("ardrone2"), omega_lsb=0.0)
HOVER = VEHICLE.hover_rate


class Bench:
    """A plant driven by rotor speeds, without filter and flight loop."""

    def __init__(self, vehicle=VEHICLE, settings=QUIET, quaternion=(1.0, 0.0, 0.0, 0.0)):
        self.loop = loop = ClosedLoop(vehicle, settings=settings)
        loop.reset(default_rng(0), np.array([0.0, 0.0, 5.0]))
        loop.quaternion[:] = quaternion
        self.plant = loop.record[0]["plant"]

    def play(self, noise, *stages):
        """Run stages of a tick with the noise (NOISE,)."""
        self.loop.noise = noise[None]
        for name in stages:
            self.loop.stages[name](self.loop)

    def run(self, command, ticks):
        """Hold rotor speeds (4,) for some ticks; return position, attitude, velocity and body rate
        after each (n, 13).
        """
        rows = np.empty((ticks, 13))
        self.loop.command[:] = command
        for row in rows:
            self.play(np.zeros(NOISE), "actuate", "move")
            row[:] = np.concatenate(self.loop.motion)
        return rows


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_torque_step_turns_it_as_a_rigid_body(axis):
    torque = np.zeros(3)
    torque[axis] = 0.004
    rows = Bench().run(VEHICLE.rotor_speeds(VEHICLE.weight, torque), 40)
    t = TICK * np.arange(1, 41)
    alpha = torque[axis] / VEHICLE.inertia[axis, axis]
    assert_allclose(rows[:, 10 + axis], alpha * t, rtol=1e-9)
    angle = Rotation.from_quat(rows[:, 3:7], scalar_first=True).as_rotvec()[:, axis]
    assert_allclose(angle, 0.5 * alpha * t**2, atol=alpha * TICK / SUBSTEPS * t[-1])
    others = [i for i in range(3) if i != axis]
    assert_allclose(rows[:, [10 + i for i in others]], 0.0, atol=1e-12)


def test_the_motors_follow_their_commands_with_the_stated_lag():
    bench = Bench(settings=replace(QUIET, motor_lag=0.04))
    command = np.array([500.0, 400.0, 300.0, HOVER])
    logged = []
    for _ in range(30):
        bench.run(command, 1)
        logged.append(bench.plant["z"][:4].copy())
    decay = np.exp(-TICK * np.arange(1, 31) / 0.04)[:, None]
    assert_allclose(logged, command + (HOVER - command) * decay, rtol=1e-12)


def test_a_motor_turns_neither_backwards_nor_too_fast():
    bench = Bench()
    bench.run([-100.0, 1e4, 0.0, HOVER], 1)
    assert_allclose(bench.plant["z"][:4], [0.0, VEHICLE.omega_max, 0.0, HOVER])


def test_the_body_gets_the_thrust_of_a_rate_that_is_not_rounded():
    vehicle = load_vehicle("ardrone2")
    assert vehicle.omega_lsb > 0
    bench = Bench(vehicle)
    bench.run([401.0] * 4, 1)
    assert bench.plant["rotor_wrench"][0] == pytest.approx(4 * vehicle.k[0] * 401.0**2, rel=1e-12)
    assert bench.plant["z"][0] != 401.0


def test_a_recorded_rotor_speed_is_rounded_once():
    vehicle = replace(load_vehicle("ardrone2"), omega_lsb=4.0)
    late = EffectSetting("clock_offset", {"dt": -0.013})
    reported = []

    def watch(loop):
        reported.append(loop.unrounded.copy())

    log = record_flight(vehicle, (late,), seconds=3.0, seed=4, push=watch)["rotor_speeds"][1:-1]
    before = np.array(reported)[1:-1]
    after = np.array(reported)[2:]
    # as it is at the pose's instant, between two ticks
    assert abs(log - (0.25 * before + 0.75 * after)).max() < 2.0 + 1e-9
    assert abs(log / 4.0 - np.round(log / 4.0)).max() < 1e-9


def test_the_disturbance_has_its_declared_size_and_lasts_as_long_as_it_says():
    """100 s on six axes: 0.03 N and 0.01 Nm, a correlation of 1/e after 0.3 s."""
    settings = PlantSettings()
    rng = default_rng(0)
    bench = Bench(settings=settings)
    disturbed = np.empty((20_000, 6))
    for row in disturbed:
        bench.play(rng.standard_normal(NOISE), "actuate")
        row[:] = bench.plant["disturbance"]
    sizes = np.repeat([settings.disturbance_force, settings.disturbance_torque], 3)
    unit = disturbed[1000:] / sizes
    assert rms(unit) == pytest.approx(1.0, abs=0.06)
    later = round(settings.disturbance_time / TICK)
    assert np.mean(unit[later:] * unit[:-later]) == pytest.approx(np.exp(-1.0), abs=0.08)


def test_a_battery_sags_by_a_twentieth_under_twice_the_hover_s_load():
    bench = Bench()
    for load in (1.0, 2.0, 1.0):
        bench.run([np.sqrt(load) * HOVER] * 4, 300)
        full = 1.05 - 0.05 * (load - 1.0) - 0.1 * bench.plant["time"] / 480.0
        assert bench.plant["battery"] / VEHICLE.voltage_ref == pytest.approx(full, abs=1e-4)


def sensed(quaternion, count=400):
    bench = Bench(settings=replace(QUIET, sensor_noise=True), quaternion=quaternion)
    rng = default_rng(0)
    rows = np.empty((count, 7))
    for row in rows:
        bench.play(rng.standard_normal(NOISE), "sense")
        row[:] = bench.plant["z"][4:11]
    return rows


def test_the_pose_s_scalar_part_is_never_negative_so_its_sign_flips_facing_backwards():
    rows = sensed(Rotation.from_euler("z", math.pi).as_quat(scalar_first=True))
    assert rows[:, 3].min() >= 0.0
    flips = np.count_nonzero(np.diff(np.sign(rows[:, 6])))
    assert flips > 50  # of 400 samples; noise alone decides the sign
    assert_allclose(norm(rows[:, 3:], axis=1), 1.0, atol=1e-14)


def test_the_pose_has_the_noise_that_the_vehicle_s_motion_capture_states():
    rows = sensed([1.0, 0.0, 0.0, 0.0], 3000)
    angles = Rotation.from_quat(rows[:, 3:], scalar_first=True).as_rotvec()
    mocap = VEHICLE.mocap
    assert_allclose(angles.std(axis=0), mocap.sigma_att_rad, rtol=0.06)
    assert_allclose(rows[:, :3].std(axis=0), mocap.sigma_pos_m, rtol=0.06)


def test_the_filter_flies_on_through_dropouts():
    loop = ClosedLoop(VEHICLE, settings=PlantSettings(dropout=0.3))
    rng = default_rng(3)
    loop.reset(rng, np.array([0.0, 0.0, 1.5]), math.pi)
    loop.run(rng.standard_normal((2000, NOISE)))
    assert loop.healthy()
    assert_allclose(loop.position, [0, 0, 1.5], atol=0.05)
    assert_allclose(loop.state[:3], loop.position, atol=0.01)
    assert eigvalsh(loop.covariance)[0] > 0


def test_the_truth_in_a_log_is_the_wrench_that_was_applied():
    effects = (
        EffectSetting("constant_force", {"fx": 0.1}),
        EffectSetting("constant_torque", {"tz": 0.01}),
    )
    log = record_flight(VEHICLE, effects, "hover", 3.0, 0, QUIET)
    assert_allclose(log["force"][1:], np.tile([0.1, 0, 0], (600, 1)), atol=1e-12)
    assert_allclose(log["torque"][1:, 2], 0.01, rtol=1e-3)


@pytest.mark.parametrize("trajectory", sorted(TRAJECTORIES))
def test_every_trajectory_is_flown_without_touching_the_ground(trajectory):
    columns = record_flight(load_vehicle("ardrone2"), (), trajectory, 15.0, 0)
    assert columns["position"][:, 2].min() > 0.05
    assert np.isfinite(columns["position"]).all()
    assert abs(columns["force"]).max() < 0.1  # the background only
    assert (abs(columns["voltage"] / 11.1 - 1.0) < 0.15).all()


@pytest.mark.parametrize("vehicle", ["ardrone2", "crazyflie", "hummingbird"])
def test_every_preset_holds_its_place(vehicle):
    columns = record_flight(load_vehicle(vehicle), (), "hover", 8.0, 0)
    error = columns["position"][800:] - [0, 0, 1.2]
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.05
