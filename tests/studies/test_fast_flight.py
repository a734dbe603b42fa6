"""The study of fast flight: a fit to force that the kit's own model made, and bad input."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.identification.motion.residual import acting_wrench
from windwrench.identification.motion.smoothing import low_pass
from windwrench.studies.fast_flight import blade_element
from windwrench.studies.fast_flight.flights import gyro_delay, read_flight, velocity_log
from windwrench.studies.fast_flight.force_fit import Regression
from windwrench.studies.fast_flight.page import tables
from windwrench.studies.fast_flight.study import (
    FULL,
    MODELS,
    force_study,
    interval,
    pose_study,
    read_flights,
    rmse,
)
from windwrench.studies.page_tables import BEGIN, END, put_between

VEHICLE = load_vehicle("ardrone2")
TRUTH = {
    ("thrust_scale", "s"): 0.03,
    ("rotor_drag", "kdx"): 1.2e-4,
    ("rotor_drag", "kdy"): 0.9e-4,
    ("com_offset", "cx"): 0.01,
    ("com_offset", "cz"): -0.02,
    ("inflow_drag", "kl"): 4e-3,
    ("rotor_interaction", "kp"): 1e-3,
    ("rotor_interaction", "kw"): 5e-4,
}
CUTOFF_HZ = 7.0


def columns(seed, seconds=16.0, period=0.005):
    """Signals of a fast flight as a file of the racer has them, drawn from sines."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, period)

    def sines(size, axes):
        out = np.zeros((len(t), axes))
        for f in (0.2, 0.45, 0.9, 1.7):
            out += size * np.sin(2 * np.pi * f * t[:, None] + rng.uniform(0, 6, axes)) / 2.0
        return out

    speeds = 380.0 + sines(60.0, 4)
    angles = sines(0.4, 3)
    half = 0.5 * angles
    quaternion = np.column_stack([np.sqrt(1.0 - np.sum(half**2, axis=1).clip(max=0.9)), half])
    position = sines(4.0, 3) + np.array([0.0, 0.0, 20.0])
    return t, position, quaternion, sines(6.0, 3), speeds


def write_racer(path, seed, own_scale=0.0, without=()):
    """Write a file with the racer's columns whose force the model with ``TRUTH`` made."""
    t, position, quaternion, velocity, speeds = columns(seed)
    names = [
        "timestamp_s",
        *(f"pos_{a}" for a in "xyz"),
        *(f"quat_{a}" for a in "wxyz"),
        *(f"vel_body_{a}" for a in "xyz"),
        *(f"gyro_{a}" for a in "xyz"),
        "rpm_front_left",
        "rpm_rear_left",
        "rpm_rear_right",
        "rpm_front_right",
        "battery_v",
    ]
    quaternion = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    w, v = quaternion[:, :1], quaternion[:, 1:]
    dq = np.gradient(quaternion, t, axis=0)
    gyro = 2.0 * (w * dq[:, 1:] - dq[:, :1] * v - np.cross(v, dq[:, 1:]))
    table = np.column_stack(
        [t, position, quaternion, velocity, gyro, speeds * 30.0 / np.pi, np.full(len(t), 11.0)]
    )
    force_columns = [f"spec_force_{a}" for a in "xyz"]
    path.write_text(",".join([*names, *force_columns]) + "\n")
    with path.open("a") as file:
        np.savetxt(file, np.hstack([table, np.zeros((len(t), 3))]), delimiter=",", fmt="%.9g")
    signals = read_flight(path, VEHICLE).signals
    effects = {}
    for (effect, name), value in TRUTH.items():
        effects.setdefault(effect, {})[name] = value
    made = VEHICLE.with_effects(*(EffectSetting(e, c) for e, c in effects.items()))
    acting, _ = acting_wrench(signals, made)
    force = np.einsum("nji,nj->ni", signals.rotation, acting[:, :3])
    force[:, 2] += own_scale * 1.03 * np.sum(VEHICLE.k * speeds**2, axis=1)
    force = low_pass(force, CUTOFF_HZ, 0.005)
    kept = [i for i, name in enumerate([*names, *force_columns]) if name not in without]
    whole = np.hstack([table, force / VEHICLE.mass])
    path.write_text(",".join(np.array([*names, *force_columns])[kept]) + "\n")
    with path.open("a") as file:
        np.savetxt(file, whole[:, kept], delimiter=",", fmt="%.9g")
    return path


def test_the_fit_finds_the_coefficients_that_made_the_force(tmp_path):
    flights = [
        read_flight(write_racer(tmp_path / f"flight_{k}.csv", k, scale), VEHICLE)
        for k, scale in ((1, 0.02), (2, -0.02))
    ]
    model = Regression(flights, VEHICLE, tuple(TRUTH)).fit([(f, slice(None)) for f in flights])
    assert model.cutoff_hz == CUTOFF_HZ
    for key, value in TRUTH.items():
        assert model.coefficients[key] == pytest.approx(value, rel=0.03), key
    assert model.own_scales["flight_1"] == pytest.approx(0.02, rel=0.05)
    for flight in flights:
        assert rmse(flight.force - model.force(flight, VEHICLE)) < 0.01


def test_coefficients_stay_within_their_ranges(tmp_path):
    flight = read_flight(write_racer(tmp_path / "flight_1.csv", 1), VEHICLE)
    upside_down = replace(flight, force=-flight.force)
    model = Regression([upside_down], VEHICLE, tuple(TRUTH)).fit([(upside_down, slice(None))])
    assert model.coefficients["rotor_drag", "kdx"] >= 0.0
    assert model.coefficients["thrust_scale", "s"] >= -0.9


def test_a_coefficient_that_no_flight_shows_keeps_its_prior(tmp_path):
    noise = np.random.default_rng(0).standard_normal
    flights = [read_flight(write_racer(tmp_path / f"flight_{k}.csv", k), VEHICLE) for k in (1, 2)]
    flights = [replace(f, force=f.force + 0.1 * noise(f.force.shape)) for f in flights]
    rho = ("ground_effect", "rho")  # they fly 20 m up
    regression = Regression(flights, VEHICLE, (*TRUTH, rho), {rho: (2.5, 0.5)})
    whole = [(flight, slice(None)) for flight in flights]
    both, one = regression.fit(whole), regression.fit(whole[:1])
    assert both.coefficients[rho] == pytest.approx(2.5, rel=1e-2)
    assert both.coefficients["rotor_drag", "kdx"] == pytest.approx(1.2e-4, rel=0.03)
    assert 0.0 < regression.doubt(both, flights[0]) < regression.doubt(one, flights[0])


def test_the_thrust_of_blade_elements_is_that_of_momentum():
    set_ = blade_element.SETTINGS
    k, radius = 1.5e-6, 0.065
    speed, edgewise, climb = np.array(
        [[1100.0, 0.0, 0.0], [1100.0, 5.0, 2.0], [1600.0, 14.0, -5.0], [1600.0, 14.0, 5.0]]
    ).T
    thrust = blade_element.rotor_thrust(speed, edgewise, climb, k, radius, set_)
    assert thrust[0] == pytest.approx(k * 1100.0**2, rel=1e-9)  # hover is as declared
    area, slope = np.pi * radius**2, set_.solidity * set_.lift_slope
    hover = np.sqrt(k / (2.0 * set_.density * area)) / radius  # induced over tip speed

    def of_blades(w, along, through):
        """Thrust by the integral of the blade over its radius, and not by its closed form."""
        r = (np.arange(2000) + 0.5) / 2000
        tip = w * radius
        pitch = (2.0 * (2.0 * hover**2) / slope + hover / 2.0) * 3.0
        lift = pitch * (r**2 + 0.5 * (along / tip) ** 2) - through / tip * r
        return 0.5 * set_.density * area * tip**2 * slope * float(np.mean(lift))

    for w, along, up, found in zip(speed, edgewise, climb, thrust, strict=True):
        induced = brentq(
            lambda v, w=w, along=along, up=up: (
                of_blades(w, along, up + v) - 2 * set_.density * area * v * np.hypot(along, up + v)
            ),
            0.0,
            30.0,
        )
        assert found == pytest.approx(of_blades(w, along, up + induced), rel=1e-5)


def test_the_librarys_terms_come_near_to_blade_elements():
    found = blade_element.project(VEHICLE)
    assert found.left < 0.2 * found.change
    known = blade_element.priors(VEHICLE)
    assert known["inflow_thrust", "kz"][0] > 0.0
    assert known["translational_lift", "kh"][0] > 0.0
    assert known["body_drag", "cz"][0] > known["body_drag", "cx"][0]


def test_the_velocity_log_measures_the_velocity_and_no_position(tmp_path):
    flight = read_flight(write_racer(tmp_path / "flight_1.csv", 1), VEHICLE)
    noise = 0.01 * np.random.default_rng(0).standard_normal(flight.log.position.shape)
    jumping = replace(flight, log=replace(flight.log, position=flight.log.position + noise))
    log = velocity_log(jumping)
    assert log.accelerometer is None
    assert log.gyro is None
    np.testing.assert_array_equal(log.position, velocity_log(flight).position)
    moved = np.diff(log.position, axis=0) / 0.005
    v = flight.signals.velocity
    np.testing.assert_allclose(moved, 0.5 * (v[1:] + v[:-1]), atol=1e-9)


def test_a_gyro_that_lags_is_put_earlier():
    t, _, quaternion, _, _ = columns(3)
    rotation = Rotation.from_quat(quaternion, scalar_first=True)
    rate = np.zeros((len(t), 3))
    rate[1:-1] = (rotation[:-2].inv() * rotation[2:]).as_rotvec() / 0.01
    late = np.column_stack([np.interp(t - 0.0075, t, column) for column in rate.T])
    assert gyro_delay(t, rotation, rate) == 0.0
    assert gyro_delay(t, rotation, late) == pytest.approx(0.0075)


def test_the_interval_of_a_figure_holds_it_and_narrows_with_more_flight():
    rng = np.random.default_rng(0)
    residual = rng.standard_normal((8000, 3))
    low, high = interval(residual, 0.005, rng)
    short_low, short_high = interval(residual[:2000], 0.005, rng)
    assert low < rmse(residual) < high
    assert high - low < short_high - short_low


def test_a_file_that_lacks_a_column_is_refused_by_name(tmp_path):
    path = write_racer(tmp_path / "flight_1.csv", 1, without=("gyro_y",))
    with pytest.raises(InputError, match=r"flight_1.*lacks gyro_y"):
        read_flight(path, VEHICLE)
    with pytest.raises(InputError, match="at least two files"):
        read_flights(tmp_path)
    with pytest.raises(InputError, match=r"flight_9"):
        read_flight(tmp_path / "flight_9.csv", VEHICLE)


def test_the_page_holds_a_figure_for_each_flight_and_model(tmp_path, monkeypatch):
    short = {"thrust alone": MODELS["thrust alone"], FULL: (tuple(TRUTH), True)}
    monkeypatch.setattr("windwrench.studies.fast_flight.study.MODELS", short)
    monkeypatch.setattr("windwrench.studies.fast_flight.page.MODELS", short)
    flights = [
        read_flight(write_racer(tmp_path / f"flight_{name}.csv", k), VEHICLE)
        for k, name in enumerate("ce")
    ]
    found = {
        "force": force_study(flights, VEHICLE, lambda text: None),
        "pose": pose_study(flights, VEHICLE),
        "filter": [],
    }
    assert found["pose"][0]["seconds"] == pytest.approx(16.0, abs=0.01)
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\n{END}\nafter\n")
    text = tables(found)
    put_between(text, page)
    assert text in page.read_text()
    assert page.read_text().startswith("before\n")
    assert page.read_text().endswith("\nafter\n")
    assert "Above the published network: 0." in text  # the model that made the force is exact
    for row in found["force"]:
        if row["model"] == FULL:
            assert f"{row['rmse']:.3f}" in text
    row = {"flight": "flight_c", "measured": "pose", "vehicle": "declared vehicle"}
    figures = {"interval": (0.1, 0.3), "rmse_slow": 0.1, "rmse_fast": 0.1}
    found["filter"] = [
        {**row, **figures, "smooth": False, "rmse": 0.2},
        {**row, **figures, "smooth": True, "rmse": 0.2},
        {**row, **figures, "smooth": False, "rmse": 0.11, "measured": "velocity"},
    ]
    text = tables(found)
    assert "of the past alone: 1." in text
    assert "* flight_c, pose measured, declared vehicle: 2.53 times 0.079 N" in text
    page.write_text("no marks")
    with pytest.raises(InputError, match="expected a page with one line"):
        put_between(text, page)
