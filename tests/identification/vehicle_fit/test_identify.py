"""Vehicles identified from nothing but mass and logs, and their exports."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.linalg import norm, pinv
from numpy.random import default_rng
from scipy.signal import butter, sosfiltfilt

from tests.identification.vehicle_fit.flown import (
    ARM,
    FULL,
    INERTIA,
    MASS,
    REACH,
    SPIN,
    K,
    X,
    Y,
    inertial_flights,
)
from tests.support.alike import assert_alike
from tests.support.data_paths import data_file
from tests.support.flown import recorded, without_pose
from tests.support.golden_identification import CRAZYFLIE, GOLDEN, made, posed, vehicles
from tests.support.outcomes import noted, refused
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting, ModelStatus, MotorCurve
from windwrench.dynamics.vehicle_file import dump_vehicle, parse_vehicle
from windwrench.identification.causal_states import causal_states
from windwrench.identification.logs.commanded_speeds import with_commanded_speeds
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.screening import screen_log
from windwrench.identification.motion.signals import in_body, log_signals
from windwrench.identification.motion.smoothing import resampled
from windwrench.identification.prediction import PredictionErrors, predict
from windwrench.identification.vehicle_fit.channels import MotionPiece, Sources
from windwrench.identification.vehicle_fit.columns import balance
from windwrench.identification.vehicle_fit.exports import EXPORTS
from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.held_out import OTHER_FLIGHTS, HeldOut, standing
from windwrench.identification.vehicle_fit.identify import checked_pieces, identify
from windwrench.identification.vehicle_fit.model import Model
from windwrench.identification.vehicle_fit.parameters import first_model
from windwrench.identification.vehicle_fit.report import explained, headline, use_of
from windwrench.identification.vehicle_fit.solve import _grams, nearest_body
from windwrench.identification.vehicle_fit.spectra import LOSS, segments_of
from windwrench.identification.wrench_series import estimate_log

GIVEN = parse_geometry(str(ARM))
HOVER = np.sqrt(MASS * 9.81 / (4 * K)) / FULL  # command


def of_crazyflie(logs, windows=None):
    return identify(logs, CRAZYFLIE.mass, parse_geometry(str(CRAZYFLIE.arm_l)), windows)


@pytest.fixture(scope="module")
def commanded():
    lag = {"motor_lag": {"tau": 0.06}}
    return [recorded(t, 15.0, vehicle=CRAZYFLIE, **lag) for t in ("excite", "yaw")]


@pytest.fixture(scope="module")
def identified(commanded):
    return of_crazyflie(commanded)


@pytest.fixture(scope="module")
def inertial():
    return inertial_flights()


def check(found, name, truth, within):
    estimate = found.estimates[name]
    assert estimate.status == "identified", estimate
    assert estimate.value == pytest.approx(truth, rel=within), estimate
    assert estimate.low < estimate.high
    assert estimate.low - 0.02 * truth < truth < estimate.high + 0.02 * truth


def test_results_are_those_kept():
    """All that identification says of made flights: predictions, changes and faults beside."""
    assert_alike(json.loads(json.dumps(made())), json.loads(GOLDEN.read_bytes()))


def test_commanded_speeds_show_the_vehicle_and_its_lag(identified):
    found = identified
    check(found, "k", CRAZYFLIE.k[0], 0.05)
    check(found, "p", CRAZYFLIE.p[0], 0.05)
    for name, moment in zip(("Jxx", "Jyy", "Jzz"), np.diag(CRAZYFLIE.inertia), strict=True):
        check(found, name, moment, 0.05)
    check(found, "motor_lag", 0.06, 0.10)
    again = parse_vehicle(dump_vehicle(found.vehicle))
    assert [e.name for e in again.effects] == ["motor_lag"]
    assert again.omega_source == "commanded"
    share = explained(found)  # of force z and all torques; along x and y nothing acts
    assert (share[2:] > 0.9).all()
    assert (share[:2] < 0.1).all()
    assert list(found.predicted) == ["held_out_blocks", "flights_left_out"]
    for errors, _ in found.predicted.values():
        assert (errors.model[:, -1] < 0.3 * errors.still[:, -1]).all()


def test_a_flight_whose_pose_is_in_pieces_is_left_out(commanded, identified):
    first, last = commanded
    broken = without_pose(replace(first, name="broken"), first.t % 2.0 < 0.2)
    found = of_crazyflie([first, broken, last])
    line = "warning: broken: left out: no piece of 3 s in flight is unbroken in pose and sensors"
    assert found.notes == (*identified.notes, line)
    assert str(found.estimates) == str(identified.estimates)  # with their NaN


def test_a_vehicle_of_rounded_speeds_reads_the_log_that_it_comes_from():
    """Its file states the step of the speeds and no fastest one: 255 steps are no limit."""
    step = 3.490658
    log = recorded("shake", 11.0, vehicle=CRAZYFLIE)
    log = replace(log, rotor_speeds=step * np.round(log.rotor_speeds / step))
    assert np.median(log.rotor_speeds) > 1.5 * 255 * step
    again = parse_vehicle(dump_vehicle(of_crazyflie([log]).vehicle))
    assert again.omega_lsb == pytest.approx(step)
    assert not any("reads" in note for note in screen_log(log, again)[1])
    force = estimate_log(log, again).force
    assert abs(np.mean(force[len(force) // 2 :], axis=0)).max() < 0.02 * again.weight


def test_early_rotor_speeds_are_an_offset_and_no_lag():
    """Rotor speeds 40 ms early, with 2 % of noise, which makes more torque than the flight: a lag,
    which smooths the noise, was likelier than the offset, and inertia 6 % off.
    """
    rng, early = default_rng(14), 8  # samples
    logs = []
    for name in ("excite", "shake", "yaw"):
        log = recorded(name, 20.0, vehicle=CRAZYFLIE)
        speeds = log.rotor_speeds * (1.0 + 0.02 * rng.standard_normal(log.rotor_speeds.shape))
        logs.append(
            FlightLog(
                log.t[:-early], log.position[:-early], log.quaternion[:-early], speeds[early:]
            )
        )
    found = of_crazyflie(logs)
    assert found.estimates["time_offset"].value == pytest.approx(0.04, abs=0.002)
    for name, truth in zip(("Jxx", "Jyy", "Jzz"), np.diag(CRAZYFLIE.inertia), strict=True):
        estimate = found.estimates[name]
        assert estimate.status == "identified"
        assert estimate.low < truth < estimate.high
    effects = {e.name: dict(e.coefficients) for e in found.vehicle.effects}
    assert effects["latency"]["d"] == pytest.approx(0.04, abs=0.002)
    assert "motor_lag" not in effects
    assert (found.vehicle.status.force, found.vehicle.status.torque) == ("identified", "identified")


def test_lift_at_the_rotors_is_not_taken_for_a_gyroscopic_torque():
    """Its moment goes with forward velocity times yaw rate, and took 7 % off Jzz and p/k."""
    bird = load_vehicle("hummingbird")
    air = {"translational_lift": {"kh": 3.4e-3}, "rotor_drag": {"kdx": 1.2e-4, "kdy": 1.2e-4}}
    logs = [recorded(name, 12.0, vehicle=bird, **air) for name in ("excite", "yaw")]
    found = identify(logs, bird.mass, parse_geometry(str(bird.arm_l)))
    check(found, "Jzz", bird.inertia[2, 2], 0.03)
    check(found, "p/k", bird.p[0] / bird.k[0], 0.03)
    check(found, "translational_lift kh", 3.4e-3, 0.1)


def test_a_hover_does_not_show_what_it_does_not_excite():
    found = of_crazyflie([recorded("hover", 6.5, vehicle=CRAZYFLIE)])
    assert found.estimates["Jzz"].status == "assumed"
    assert found.estimates["motor_lag"].status == "not identifiable"
    assert any("Yaw at" in line for line in found.advice)
    parse_vehicle(dump_vehicle(found.vehicle))


def test_an_imu_and_commands_are_enough():
    found = vehicles()["imu and commands"]
    assert found.fit.model.sources.force == "accelerometer"
    check(found, "hover command", HOVER, 0.05)
    check(found, "thrust(0.5)", K * (0.5 * FULL) ** 2, 0.05)
    check(found, "Jxx", INERTIA[0, 0], 0.05)
    check(found, "Jyy", INERTIA[1, 1], 0.05)
    check(found, "(p/k)/Jzz", REACH / INERTIA[2, 2], 0.05)
    check(found, "motor_lag", 0.05, 0.10)
    assert found.estimates["drag"].status == "not identifiable"
    vehicle = parse_vehicle(dump_vehicle(found.vehicle))
    assert vehicle.motor_curve is not None
    thrust = vehicle.commanded_thrust(np.full((1, 4), HOVER))
    assert thrust.sum() == pytest.approx(MASS * 9.81, rel=0.05)


def test_quick_changes_of_velocity_are_the_accelerometers():
    """The noise of a pose made drag too small."""
    log = recorded(seconds=10.0)
    (s,) = log_signals(log)
    felt = in_body(s.acceleration + np.array([0.0, 0.0, 9.81]), s.rotation)
    imu = resampled(log.t, s.t, np.hstack([felt, s.angular_velocity]))
    position = log.position + 0.005 * default_rng(0).standard_normal(log.position.shape)
    blind = replace(log, position=position, gyro=imu[:, 3:])
    off = []
    for seen in (blind, replace(blind, accelerometer=imu[:, :3])):
        ((piece,), _), ((clean,), _) = checked_pieces([seen]), checked_pieces([log])
        off.append((resampled(clean.t, piece.t, piece.velocity) - clean.velocity)[20:-20].std())
    assert off[1] < 0.5 * off[0]


def test_noise_of_speeds_is_taken_off_slow_torques_too():
    """A share of answered torque near 1 left less than no power."""
    rng, t = default_rng(0), np.arange(0.0, 60.0, 0.01)
    still = np.zeros((len(t), 3))
    speeds = 500.0 + 5.0 * rng.standard_normal((len(t), 4))
    piece = MotionPiece(0, t, 0.01, still, still, still, rotors=speeds)
    sources = Sources("", "gyro", "rotor speeds", False)
    model = Model(MASS, GIVEN, sources, speed_noise=5.0, free=("delay",))
    made = balance([piece], model, np.zeros(1))
    spectra = [np.ones((len(s.frequency), 6)) for s in made.segments]
    left = np.sum(_grams(made, spectra), axis=0)[3]
    at = [1 + made.names.index(name) for name in ("x2", "slow x2")]
    power = sum(np.square(np.abs(s.columns[:, :, at[0] + 5])).sum() for s in made.segments)
    assert (np.abs(np.diag(left)[at]) < 0.05 * power).all()


def test_a_lag_that_a_time_offset_may_be_is_assumed(inertial):
    """The file held it without a doubt. Without any lag thrust would be early."""
    log, _ = inertial[0]
    noise = default_rng(0).standard_normal((2, *log.gyro.shape))
    force, rate = log.accelerometer + 9.0 * noise[0], log.gyro + 0.3 * noise[1]
    found = identify([replace(log, accelerometer=force, gyro=rate)], MASS, GIVEN)
    again = parse_vehicle(dump_vehicle(found.vehicle))
    assert [e.name for e in again.effects] == ["motor_lag"]
    assert again.status.coefficients["motor_lag"] == found.estimates["motor_lag"].status
    assert found.estimates["motor_lag"].status == "assumed"


def test_poses_too_seldom_for_a_velocity_leave_the_imu(inertial):
    log, _ = inertial[0]
    seldom = np.arange(len(log.t)) % 25 == 0
    pose = np.where(seldom[:, None], default_rng(0).normal(0.5, 0.001, (len(log.t), 7)), np.nan)
    log = replace(log, position=pose[:, :3], quaternion=pose[:, 3:], valid=seldom)
    check(identify([log], MASS, GIVEN), "Jxx", INERTIA[0, 0], 0.05)


def test_a_discharge_tells_the_voltage_from_the_thrust_curve(inertial):
    log, _ = inertial[0]
    volts = np.linspace(4.2, 3.5, len(log.t))
    used = replace(log, voltage=volts, command=log.command * (volts[:, None] / 3.85) ** -0.6)
    found = identify([used], MASS, GIVEN)
    check(found, "voltage_exponent", 1.2, 0.15)
    empty, full = (e for e in found.estimates.values() if e.name.startswith("hover command at"))
    for volt, known in ((3.535, empty), (4.165, full)):
        assert known.low < HOVER * (volt / 3.85) ** -0.6 < known.high
    assert found.vehicle.motor_curve.voltage_exponent == found.estimates["voltage_exponent"].value


def test_tapers_lose_what_the_intervals_add():
    """A regression of white noise on white noise, of density 0.01: its variance by its weight."""
    rng = default_rng(0)
    off = []
    for noise in rng.standard_normal((2000, 500, 2)):
        (s,) = segments_of(noise, 0.01 * np.arange(len(noise)), 0.01, 0, np.inf)
        x, y = np.moveaxis(s.columns * np.sqrt(s.weight)[:, None], 2, 0)
        off.append(np.vdot(x, y).real / norm(x))
    assert np.var(off) == pytest.approx(0.01 * LOSS, rel=0.08)  # 1.17: 1 would be off


@pytest.mark.slow
def test_intervals_hold_the_truth_about_as_often_as_they_say():
    held = []
    for log, speeds in inertial_flights(range(8), 15.0):
        log = replace(log, rotor_speeds=speeds, command=None)
        found = identify([log], MASS, GIVEN)
        for name, truth in (("k", K), ("Jxx", INERTIA[0, 0]), ("Jyy", INERTIA[1, 1])):
            held.append(found.estimates[name].low <= truth <= found.estimates[name].high)
    assert sum(held) >= 20  # of 24; 95 % intervals miss more than 4 once in 170 times


def test_torque_that_loses_to_a_rate_that_stays_tells_no_inertia(commanded, monkeypatch):
    """As where the flight loop answers what nothing measures: 17 against .7 rad/s was a warning."""

    def errors(_, vehicles):
        kept = {"identified": 2.0, "refuted": 1.0}
        moved = {"identified": 0.5, "refuted": 1.0}
        each = [(moved[v.status.force], kept[v.status.torque]) for v in vehicles]
        return [of(force, force, torque, torque) for force, torque in each]

    where = "windwrench.identification.vehicle_fit.held_out"
    monkeypatch.setattr(f"{where}.errors_at", errors)
    logs = commanded[:1]
    found = of_crazyflie(logs)
    check(found, "k", CRAZYFLIE.k[0], 0.05)
    status = parse_vehicle(dump_vehicle(found.vehicle)).status
    assert (status.force, status.torque) == ("identified", "refuted")
    assert status.coefficients["k"] == "identified"
    assert status.coefficients["Jxx"] == "assumed"
    assert "unchanged body rate" in use_of(found)
    for name in ("Jxx", "Jyy", "Jzz", "p/k", "p", "com x", "com y", "flapping_moment kflap"):
        assert found.estimates[name].status in ("assumed", "not identifiable")
        assert "(2 against 1 rad after 0.5 s)" in found.estimates[name].how
    assert found.estimates["Jxx"].high > 3.0 * found.estimates["Jxx"].low
    assert (found.vehicle.com == 0.0).all()
    assert any("roll movements" in line for line in found.advice)
    with refused(r"2 against 1 rad.*no arm is given; expected --geometry"):
        identify(logs, CRAZYFLIE.mass, parse_geometry(None))


def test_a_refuted_force_takes_its_drag_along(monkeypatch):
    where = "windwrench.identification.vehicle_fit.identify.held_out"
    monkeypatch.setattr(where, lambda *_: HeldOut({}, "torque"))
    found = identify(posed(), CRAZYFLIE.mass, parse_geometry(None))
    lost = {name for name, e in found.estimates.items() if e.status == "refuted"}
    assert lost == {"k", "body_drag dx", "body_drag dy"}
    assert "identified: nothing; assumed" in headline(found)


def of(position, velocity, attitude, rate):
    model = np.array([[position], [velocity], [attitude], [rate]])
    return PredictionErrors(9, np.array([0.5]), model, np.ones((4, 1)))


@pytest.mark.parametrize(
    ("whole", "keeps_rate", "simplest", "stands"),
    [
        ((0.2, 0.2, 0.2, 0.2), (0.5, 0.5, 1, 1), (0.5, 0.5, 1, 1), "force and torque"),
        ((0.2, 0.2, 0.2, 9.0), (0.4, 0.4, 1, 1), (0.5, 0.5, 1, 1), "force"),
        ((0.6, 0.6, 0.5, 0.5), (0.4, 0.4, 1, 1), (0.5, 0.5, 1, 1), "force"),
        ((3.0, 3.0, 3.0, 3.0), (0.9, 0.9, 1, 1), (0.5, 0.5, 1, 1), "thrust and drag"),
        ((3.0, 3.0, 3.0, 3.0), (2.0, 2.0, 1, 1), (2.0, 2.0, 1, 1), "no change"),
    ],
)
def test_the_model_that_is_nowhere_worse_stands(whole, keeps_rate, simplest, stands):
    errors = {
        "no change": of(1, 1, 1, 1),
        "thrust and drag": of(*simplest),
        "force": of(*keeps_rate),
        "force and torque": of(*whole),
    }
    each = {name: [error] for name, error in errors.items()}
    assert standing({"held_out_blocks": each}) == stands


def test_a_model_stands_on_each_flight():
    """The means are alike: 20 % better on both, or 45 % better on one and 16 % worse on another."""
    still = [of(1, 1, 1, 1), of(1, 1, 1, 1)]
    for rates, stands in (((0.8, 0.8), "loop"), ((0.55, 1.16), "no change")):
        loop = [of(1, 1, 1, rate) for rate in rates]
        errors = {"no change": still, "thrust and drag": still, "loop": loop}
        assert standing({OTHER_FLIGHTS: errors}) == stands


def test_torques_that_fail_on_their_own_flight_turn_no_prediction(commanded, monkeypatch):
    """12 times the error of no change, on flights of 9 s of which nothing can be held out."""

    def errors(_, vehicles):
        return [of(*4 * [2.0 if v.closed_loop is None else 1.0]) for v in vehicles]

    monkeypatch.setattr("windwrench.identification.vehicle_fit.held_out.errors_at", errors)
    found = of_crazyflie(commanded[:1], [(2.0, 9.0)])
    assert found.vehicle.status.torque == "assumed"
    assert "closed_loop damping" in found.estimates


def test_a_vehicle_that_is_refuted_keeps_its_motion(commanded):
    log = commanded[0]
    status = ModelStatus("refuted", "refuted")
    path = predict(log, replace(CRAZYFLIE, status=status), every=200)
    state = causal_states(log, CRAZYFLIE)[path.start]
    ahead = path.period * np.arange(1, path.velocity.shape[1] + 1)[:, None]
    assert path.velocity == pytest.approx(
        np.broadcast_to(state[:, None, 7:10], path.velocity.shape)
    )
    assert path.position == pytest.approx(state[:, None, :3] + ahead * state[:, None, 7:10])
    still = np.broadcast_to(state[:, None, 10:], path.velocity.shape)
    assert path.angular_velocity == pytest.approx(still, abs=1e-4)


def test_commands_are_read_by_the_curve_of_the_vehicle_that_predicts(inertial):
    """Rotor speeds of a preset's curve stayed in the log: 3 m off after .5 s."""
    log, speeds = inertial[0]
    curve = MotorCurve((0.0, 0.0, K * FULL**2))
    vehicle = replace(CRAZYFLIE, k=np.full(4, K), motor_curve=curve)
    other = replace(log, rotor_speeds=0.5 * speeds, commanded=True)
    again = with_commanded_speeds(other, vehicle)
    assert again.rotor_speeds == pytest.approx(FULL * log.command)
    measured = replace(log, rotor_speeds=speeds)
    assert with_commanded_speeds(measured, vehicle) is measured


def test_an_inertia_that_no_body_has_moves_to_the_nearest(identified):
    fit = identified.fit
    flat = fit.theta.copy()
    flat[fit.model.free.index("Jz")] += 0.4
    body, size = nearest_body(replace(fit, theta=flat))
    values = body.values
    assert values["Jz"] == pytest.approx(0.995 * (values["Jx"] + values["Jy"]))
    assert size > 3.0
    same, none = nearest_body(body)
    assert none == 0.0
    assert same.values == values


def test_rotor_speeds_that_no_quadrotor_has_are_refused():
    """What reading says of these and of others is in ``tests/golden/logs.json``."""
    line = "are 390, 395, 393, 70.7 rad/s; expected a ratio of at most 1.5"
    with pytest.warns(UserWarning, match=line):
        flight = read_log(data_file("hard_logs/px4_one_esc_low.ulg"))
    with refused(line):
        identify([flight], 1.5, parse_geometry("0.17"))


def test_a_mass_in_grams_is_refused(inertial):
    with refused("--mass 500 with rotors 0.12 m from the body axes"):
        identify([inertial[0][0]], 1e3 * MASS, GIVEN)


def test_rotors_in_another_order_are_refused(inertial):
    log, _ = inertial[0]
    wrong = replace(log, command=log.command[:, [3, 2, 1, 0]])
    with refused("roll turns against"):
        identify([wrong], MASS, GIVEN)
    (flight,) = posed()
    with refused("the rotors look permuted: .* are rotors 2,1,3,4"):
        of_crazyflie([replace(flight, rotor_speeds=flight.rotor_speeds[:, [1, 0, 2, 3]])])


def test_flights_of_two_vehicles_are_refused():
    (flight,) = posed()
    other = replace(flight, name="heavier", rotor_speeds=1.3 * flight.rotor_speeds)
    with refused("the same rotor speeds give 69% more thrust than on heavier"):
        of_crazyflie([flight, other])


def test_turning_is_compared_with_torque_at_its_own_delay():
    """60 ms of 4 to 7 Hz are more than a quarter of a turn: at no delay all looks opposed."""
    rng = default_rng(3)
    period = 0.01
    late = 6
    n = 3000
    band = butter(2, [8.0 * period, 14.0 * period], btype="bandpass", output="sos")
    turn = sosfiltfilt(band, rng.standard_normal((n, 3)), axis=0) * [3.0, 3.0, 1.0]
    mixing = np.array([Y, -X, -REACH * SPIN])
    torque = INERTIA @ np.roll(turn, -late, axis=0).T
    square = np.maximum((FULL * HOVER) ** 2 + (pinv(mixing) @ torque / K).T, 0.0)
    still, force = np.zeros((2, n, 3))
    force[:, 2] = K / MASS * square.sum(axis=1)
    t = period * np.arange(n)
    rate = period * np.cumsum(turn, axis=0)
    piece = MotionPiece(0, t, period, force, turn, rate, still, np.sqrt(square), None, None)
    sources = Sources("accelerometer", "gyro", "rotor speeds", True)
    model, start = first_model([piece], Model(MASS, GIVEN, sources), "delay")
    values = model.values(start)
    assert not model.opposite
    assert values["Jx"] == pytest.approx(INERTIA[0, 0], rel=0.2)
    assert values["Jy"] == pytest.approx(INERTIA[1, 1], rel=0.2)


def test_rotors_that_turn_the_other_way_are_recognised(inertial):
    log, speeds = inertial[0]
    # the same flight with the right side called the front: each place has its neighbour's rotor
    turned = replace(
        log,
        command=None,
        rotor_speeds=speeds[:, [3, 0, 1, 2]],
        gyro=np.column_stack([-log.gyro[:, 1], log.gyro[:, 0], log.gyro[:, 2]]),
    )
    found = identify([turned], MASS, GIVEN)
    assert found.vehicle.spin.tolist() == [1.0, -1.0, 1.0, -1.0]
    assert noted(found, "opposite")
    check(found, "Jxx", INERTIA[1, 1], 0.05)


@pytest.mark.parametrize("window", [(5.0, 5.5), (100.0, 200.0)])
def test_a_part_that_is_too_short_is_refused(inertial, window):
    with refused("no piece of 3 s"):
        identify([inertial[0][0]], MASS, GIVEN, [window])


def found(*effects, curve=None):
    """Return as much of a result as exports read."""
    vehicle = replace(CRAZYFLIE.with_effects(*effects), motor_curve=curve)
    fit = SimpleNamespace(model=SimpleNamespace(commands=curve is not None))
    return SimpleNamespace(vehicle=vehicle, estimates={}, fit=fit)


def test_px4_and_ardupilot_predict_the_drag_that_the_vehicle_has():
    effects = (
        EffectSetting("rotor_drag", {"kdx": 2e-6, "kdy": 2e-6}),
        EffectSetting("body_drag", {"cx": 4e-4, "cy": 6e-4}),
    )
    it = found(*effects)
    v = it.vehicle
    speed = 3.0
    set_to = dict(re.findall(r"param set (\S+) (\S+)", EXPORTS["px4"](it)))
    predicted = float(set_to["EKF2_MCOEF"]) * speed
    predicted += 0.5 * 1.225 * speed**2 / float(set_to["EKF2_BCOEF_Y"])
    force = 4 * v.hover_rate * 2e-6 * speed + 6e-4 * speed**2
    assert predicted == pytest.approx(force / v.mass, rel=1e-3)
    lines = dict(x.split(",") for x in EXPORTS["ardupilot"](it).splitlines() if x[0] != "#")
    assert float(lines["EK3_DRAG_MCOEF"]) == float(set_to["EKF2_MCOEF"])
    assert float(lines["EK3_DRAG_BCOEF_X"]) == float(set_to["EKF2_BCOEF_X"])
    assert "not known from these logs: MPC_THR_HOVER, THR_MDL_FAC" in EXPORTS["px4"](it)


def test_the_thrust_curve_hovers_where_the_autopilot_thinks():
    full = 0.15
    bend = 0.7
    it = found(curve=MotorCurve((0.0, (1 - bend) * full, bend * full)))
    text = EXPORTS["px4"](it)
    set_to = {k: float(x) for k, x in re.findall(r"param set (\S+) (\S+)", text)}
    assert set_to["THR_MDL_FAC"] == pytest.approx(bend, rel=1e-3)
    # relative thrust T = f u^2 + (1 - f) u; at hover four rotors carry the weight
    assert 4 * full * set_to["MPC_THR_HOVER"] == pytest.approx(it.vehicle.weight, rel=1e-3)
    assert "EKF2_MCOEF" not in set_to
    assert f"MOT_THST_EXPO,{bend:g}" in EXPORTS["ardupilot"](it)
