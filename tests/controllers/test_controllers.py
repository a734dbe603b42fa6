"""Controllers: which way they push and what they need; laws of the tasks beside FanTracking."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from tests.support.sizes import rms
from tests.support.vehicles import VEHICLE
from windwrench import _core
from windwrench.controllers import CONTROLLERS, AdmittancePID, make_controller
from windwrench.controllers import wind_observation as seen
from windwrench.controllers.axis_models import PLACE, axis_models
from windwrench.controllers.flight import BESIDE, flight_record
from windwrench.controllers.lqg import LQG
from windwrench.controllers.observation import (
    DECISION_PERIOD,
    FORCE_X,
    MAX_COMMAND,
    OBSERVATION_SIZE,
    TORQUE_Z,
)
from windwrench.controllers.preview import DISTURBANCE_TIME, lasting
from windwrench.controllers.registry import TASK_LAWS, tuned_gains
from windwrench.controllers.wind_laws import INDI, PID, L1Adaptive, PIDWithWrench
from windwrench.controllers.wind_observation import WIND_PERIOD
from windwrench.envs.closed_loop import ClosedLoop
from windwrench.envs.plant import TICK, PlantSettings
from windwrench.envs.wind_tasks import WindHoverEnv, WindTrajectoryEnv
from windwrench.estimator.estimate import STATE_SIZE
from windwrench.evaluation.episodes import fly_episode


@pytest.mark.parametrize("task", sorted(TASK_LAWS.keys() - {"FanTracking"}))
def test_every_law_flies_with_the_gains_that_were_found(task):
    tuned = tuned_gains("WindHover" if task == "WindTrajectory" else task)
    for name in TASK_LAWS[task].keys() & tuned:
        assert tuned[name]["rmse_m"] <= tuned[name]["default_rmse_m"]
        assert tuned[name]["gains"].items() <= vars(make_controller(name, task)).items()


def frame(**parts):
    o = np.zeros(seen.WIND_OBSERVATION_SIZE)
    for name, value in parts.items():
        o[getattr(seen, name)] = value
    return o


def test_the_integral_of_a_pid_waits_at_the_limit():
    law = PID(kp=2.0, kd=3.0, ki=0.5)
    for _ in range(100):
        assert law(frame(POSITION_ERROR=[3.0, 0, 0]))[0] == 4.0
    law.kp = 0.0
    assert abs(law(frame())[0]) < 0.01


def hovering(**parts):
    return frame(SPECIFIC_FORCE=[0, 0, 9.81], ROTOR_FORCE=[0, 0, 9.81], **parts)


@pytest.mark.parametrize("law", [INDI(), L1Adaptive()])
def test_the_flight_loop_turns_against_a_steady_torque(law):
    """The attitude loop makes k_attitude a / g of an acceleration; tau / J stands against it."""
    law(hovering())
    ahead, *_, action = (law(hovering(TORQUE=[0.01, 0.02, 0.03])) for _ in range(101))
    inertia = VEHICLE.inertia
    cancels = 9.81 / 110.0 * np.array([-0.02 / inertia[1, 1], 0.01 / inertia[0, 0], 0.0])
    assert_allclose(action, cancels, atol=1e-6)
    assert ahead[0] < action[0]  # a torque that grows is met before it is seen in full


@pytest.mark.parametrize("pushed", ["action", "force", "torque", "set point"])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_axis_moves_as_the_vehicle_in_mujoco_does(axis, pushed):
    """Steps of 0.5 m/s2, 0.2 N, 0.01 Nm and 0.2 m/s, for 0.8 s, without any noise."""
    if (axis, pushed) == (2, "torque"):
        pytest.skip("a torque does not lift")
    quiet = PlantSettings(disturbance_force=0.0, disturbance_torque=0.0, sensor_noise=False)
    loop = ClosedLoop(VEHICLE, settings=quiet)
    loop.reset(default_rng(0), np.array([0.0, 0.0, 1.5]), np.pi)
    model = axis_models(VEHICLE)[axis]
    if pushed == "set point":
        model = model.with_set_point()
    A, B, D = model.held(TICK)
    command = 0.0
    push = np.zeros(D.shape[1])
    if pushed == "action":
        command = loop.action[axis] = 0.5
    elif pushed == "set point":
        command = loop.setpoint[3 + axis] = 0.2
    elif pushed == "force":
        push[0] = loop.applied[axis] = 0.2
    else:
        push[1] = 0.01
        loop.applied[3 + (1, 0)[axis]] = (1, -1)[axis] * 0.01
    x = np.zeros(len(A))
    start = loop.position[axis]
    there = []
    expected = []
    for _ in range(160):
        loop.run(np.zeros((1, loop.noise_size)))
        x = A @ x + B[:, 0] * command + D @ push
        there.append(loop.position[axis] - start)
        expected.append(x[PLACE])
    largest = np.abs(expected).max()
    assert largest > 0.005
    # the filter and the ticks between sample and command are not in the model
    assert abs(np.array(there) - expected).max() < 0.12 * largest


def test_the_torque_is_answered_before_anything_has_moved():
    law = LQG()
    law(hovering())
    felt = hovering(TORQUE=[-0.02, 0.02, 0.0])
    x, y, z = law(felt)
    assert x < -0.05
    assert y < -0.05
    assert abs(z) < 1e-6
    heavy = replace(VEHICLE, inertia=2.0 * VEHICLE.inertia)
    fed = PIDWithWrench(tilt=20.0, tilt_lead=0.1, vehicle=heavy)
    assert_allclose(fed(felt), [-0.2, -0.2, 0.0], atol=1e-6)
    expected = -10.0 * (0.03 + 0.1 * 0.01 / WIND_PERIOD)
    assert_allclose(fed(hovering(TORQUE=[-0.02, 0.03, 0.0]))[0], expected, rtol=1e-5)


@pytest.mark.parametrize(
    ("felt", "axes", "time", "other"),
    [
        ({"FORCE": [0.0, 0.0, 0.1]}, [2], "force_time", "torque_time"),
        ({"TORQUE": [-0.01, 0.01, 0.0]}, [0, 1], "torque_time", "force_time"),
    ],
)
def test_what_lasts_longer_is_answered_by_more(felt, axes, time, other):
    """A torque has no part in the vertical axis, and a force's duration none in a torque's answer
    (0.1 %).
    """

    def answer(**times):
        law = LQG(**times)
        return abs([law(hovering(**felt)) for _ in range(10)][-1][axes])

    usual = answer()
    assert (answer(**{time: 4.0 * getattr(LQG, time)}) > 1.01 * usual).all()
    assert (answer(**{time: 0.25 * getattr(LQG, time)}) < 0.97 * usual).all()
    for share in (0.25, 4.0):
        assert_allclose(answer(**{other: share * getattr(LQG, other)}), usual, rtol=5e-3)


def test_a_small_vehicle_is_flown_as_well():
    env = WindHoverEnv(vehicle="crazyflie", episode_s=8.0)
    assert fly_episode(env, LQG(), 900_000).rmse_settled < 0.01  # 0.04 with another's noise


class Unturned(LQG):
    """Takes every reference for one that has not changed its acceleration."""

    def __call__(self, observation, info=None):
        self._wanted = None
        return super().__call__(observation, info)


def test_a_reference_that_turns_is_followed_closer_where_the_turn_is_known():
    env = WindTrajectoryEnv("calm")
    known, unknown = (fly_episode(env, law, 3).error[75:] for law in (LQG(), Unturned()))
    assert rms(known) < 0.8 * rms(unknown)


def test_a_steady_bias_of_the_accelerometer_is_no_wind():
    """Where neither pose nor wrench shows a force, what the accelerometer shows is its bias."""
    biased = frame(SPECIFIC_FORCE=[0.05, -0.05, 9.86], ROTOR_FORCE=[0, 0, 9.81])
    told, untold = (np.abs([law(biased) for _ in range(101)]) for law in (LQG(), LQG(bias=1e-6)))
    assert_allclose(told[0], untold[0], rtol=0.01)
    assert (told[100] < 0.5 * untold[100]).all()


def observation(torque=0.0, force=0.5):
    o = np.zeros(OBSERVATION_SIZE, dtype=np.float32)
    o[TORQUE_Z], o[FORCE_X] = torque, force
    return o


@pytest.mark.parametrize("name", sorted(CONTROLLERS.keys() - {"oracle"}))
def test_a_command_is_one_number_within_bounds(name):
    controller = make_controller(name)
    controller.reset()
    for torque in (0.0, 0.02, -5.0):
        command = controller(observation(torque))
        assert command.shape == (1,)
        assert abs(command[0]) <= MAX_COMMAND


def test_the_flight_loop_s_commands_can_be_flown():
    turning = np.zeros(STATE_SIZE)
    turning[2], turning[3], turning[10:13] = 1.0, 1.0, (30.0, -30.0, 10.0)
    for where in ({0: 100.0, 1: -100.0, 2: 100.0, 9: 3.0}, {2: -100.0}):
        c = flight_record(VEHICLE)[0]
        for index, value in where.items():
            c["setpoint"][index] = value
        fly(c, turning)
        assert np.isfinite(c["command"]).all()
        assert np.all((c["command"] >= 0) & (c["command"] <= VEHICLE.omega_max))


def fly(c, x):
    """Let a flight loop's record command the rotors in a state (20,)."""
    _core.steer(np.asarray(c).ctypes.data, x, np.zeros(4), BESIDE, TICK)


def move_setpoint(c, position):
    _core.move_setpoint(np.asarray(c).ctypes.data, position, TICK)


def flown(c, q, rate=(0.0, 0.0, 0.0)):
    """Thrust (N) and torques (Nm, body) that a flight loop commands at an attitude and a rate."""
    x = np.zeros(STATE_SIZE)
    x[3:7], x[10:13] = q.as_quat(scalar_first=True), rate
    return commanded(c, x)


def commanded(c, x):
    """Thrust (N) and torques (Nm, body) that a flight loop commands in a state."""
    fly(c, x)
    thrust, *torque = VEHICLE.mixing @ c["command"] ** 2
    return thrust, np.array(torque)


@pytest.mark.parametrize(("axis", "pitched"), [(0, 1.0), (1, -1.0)])
def test_a_far_set_point_tilts_by_the_limit_and_no_further(axis, pitched):
    about = np.eye(3)[1 - axis] * pitched
    for tilt, sign in ((0.49, 1.0), (0.51, -1.0)):
        c = flight_record(VEHICLE)[0]
        c["setpoint"][axis] = 100.0
        _, torque = flown(c, Rotation.from_rotvec(tilt * about))
        assert sign * torque @ about > 1e-3


def test_a_vehicle_that_sinks_keeps_three_tenths_of_its_weight_to_steer_with():
    c = flight_record(VEHICLE)[0]
    c["setpoint"][2] = -100.0
    thrust, _ = flown(c, Rotation.identity())
    assert thrust == pytest.approx(0.3 * VEHICLE.weight)


def test_a_steady_turn_about_the_vertical_costs_a_tilted_vehicle_the_gyroscopic_torque_alone():
    tilted = flight_record(VEHICLE)[0]
    turning = flight_record(VEHICLE)[0]
    q = Rotation.from_euler("zyx", [0.7, 0.1, -0.2])
    rate = q.inv().apply([0.0, 0.0, 1.5])
    tilted["setpoint"][9] = turning["setpoint"][9] = 0.7
    turning["setpoint"][10] = 1.5
    more = flown(turning, q, rate)[1] - flown(tilted, q)[1]
    assert_allclose(more, np.cross(rate, VEHICLE.inertia @ rate), atol=1e-12)


@pytest.mark.parametrize("period", [WIND_PERIOD, DECISION_PERIOD])
def test_what_an_oracle_expects_of_a_disturbance_is_its_mean_over_each_decision(period):
    t = np.arange(0.0, 12 * period, period / 200) + period / 400
    means = np.exp(-t / DISTURBANCE_TIME).reshape(12, 200).mean(axis=1)
    wrench = np.array([0.2, -0.01])
    assert_allclose(lasting(wrench, 12, period), np.outer(means, wrench), rtol=4e-3)


def test_a_moving_set_point_waits_for_the_vehicle():
    c = flight_record(VEHICLE)[0]
    c["setpoint"][4] = 1.0
    for _ in range(400):
        move_setpoint(c, np.zeros(3))
    # it stops within one step of 5 mm of the leash's end
    assert c["leash"] - 0.0051 <= c["setpoint"][1] <= c["leash"]
    c["setpoint"][4] = -1.0
    move_setpoint(c, np.zeros(3))
    assert c["setpoint"][1] < c["leash"] - 0.005


@pytest.mark.parametrize(
    ("velocity", "vehicle", "there"),
    [
        ([0.0, 0.0, 0.0], [3.0, -2.0, 1.0], [0.0, 0.0, 0.0]),  # at rest it is not dragged along
        ([-0.4, 0.4, 0.4], [-3.0, 3.0, -3.0], [-0.4, 0.4, 0.0]),  # it comes nearer, not further
    ],
)
def test_a_set_point_beyond_the_leash_still_comes_back(velocity, vehicle, there):
    """A gust has thrown the vehicle 3 m off; it must find its way back."""
    c = flight_record(VEHICLE)[0]
    c["setpoint"][3:6] = velocity
    expected = np.concatenate([there, c["setpoint"][3:]])
    for _ in range(200):
        move_setpoint(c, np.array(vehicle))
    assert_allclose(c["setpoint"], expected, atol=1e-12)


def test_a_vehicle_held_for_long_is_not_thrown_on():
    """Held 1 m low and 1 rad off for a minute: the integrals push by 2 m/s2 and 4 rad/s2. Let go,
    it rises 0.36 m too far.
    """
    c = flight_record(VEHICLE)[0]
    x = np.zeros(STATE_SIZE)
    x[3], c["setpoint"][2], c["setpoint"][9] = 1.0, 1.0, 1.0

    def pushed():
        thrust, torque = commanded(c, x)
        return thrust / VEHICLE.mass - VEHICLE.gravity, torque[2] / VEHICLE.inertia[2, 2]

    for _ in range(60 * 200):
        fly(c, x)
    x[2] = 1.0
    c["setpoint"][9] = 0.0
    assert_allclose(pushed(), [2.0, 4.0], rtol=1e-9)
    x[2] = 0.0
    highest = 0.0
    for _ in range(10 * 200):
        x[9] += 0.005 * pushed()[0]
        x[2] += 0.005 * x[9]
        highest = max(highest, x[2])
    assert highest < 1.4


def test_the_integral_follows_and_does_not_wind_up():
    pid = AdmittancePID(gain=1.0, integral=10.0, lead=0.0)
    for _ in range(10):
        command = pid(observation(0.02))[0]
    assert command == pytest.approx(-(0.02 + 10.0 * 10 * 0.08 * 0.02), rel=1e-4)
    for _ in range(1000):
        pid(observation(0.2))
    assert -MAX_COMMAND <= pid(observation(0.2))[0] <= -0.8
    # a torque of the other sign takes it off the bound at once, not after as long a time
    turned = [pid(observation(-0.2))[0] for _ in range(12)]
    assert turned[-1] > 0.0
    pid.reset()
    assert pid(observation(0.0))[0] == 0.0
