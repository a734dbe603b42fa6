"""The fan's jet: what flow it is, and what it does to a vehicle in it."""

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.spatial.transform import Rotation

from windwrench.dynamics import load_vehicle
from windwrench.envs.fan import (
    HULL_RADIUS,
    STATIONS,
    Fan,
    fan_record,
    gust,
    jet_at,
    jet_table,
    jet_wrench,
)

VEHICLE = load_vehicle("ardrone2")
PERIOD = 0.005
FAN = Fan(turbulence=0.0)
AXIAL, RADIAL = jet_table(FAN.radius, FAN.hub_radius)
DISTANCE = 2.3


def wind(x, y, z, fan=FAN):
    out = np.full(3, np.nan)
    jet_at(fan_record(fan, VEHICLE.positions, PERIOD)[0], AXIAL, RADIAL, x, y, z, out)
    return out


def wrench(
    y, x=DISTANCE, z=FAN.height, yaw=np.pi, fan=FAN, velocity=(0.0, 0.0, 0.0), com=(0.0, 0.0, 0.0)
):
    """Force and torque (6,), world, on a level vehicle that faces the fan."""
    out = np.full(6, np.nan)
    jet_wrench(
        fan_record(fan, VEHICLE.positions, PERIOD)[0],
        AXIAL,
        RADIAL,
        np.array([x, y, z]),
        Rotation.from_euler("z", yaw).as_matrix(),
        np.array(velocity),
        np.zeros(3),
        np.array(com),
        np.empty(3),
        out,
    )
    return out


OFFSETS = np.linspace(-1.2, 1.2, 241)


@pytest.fixture(scope="module")
def profile():
    """Wrench (n, 6) at the offsets."""
    return np.array([wrench(y) for y in OFFSETS])


def test_the_yaw_torque_is_odd_in_the_offset_and_the_force_even(profile):
    np.testing.assert_allclose(profile[:, 5], -profile[::-1, 5], atol=1e-12)
    np.testing.assert_allclose(profile[:, 0], profile[::-1, 0], rtol=1e-9)
    assert wrench(0.0)[5] == pytest.approx(0.0, abs=1e-14)


def test_the_yaw_torque_is_the_paper_s_in_size_and_place(profile):
    at = OFFSETS[np.argmax(profile[:, 5])]
    assert 0.4 <= at <= 0.6
    assert 0.02 <= profile[:, 5].max() <= 0.05


def test_the_force_blows_away_from_the_fan_everywhere_in_the_jet(profile):
    assert np.all(profile[:, 0] > 0.0)
    assert 0.4 < wrench(0.0)[0] < 0.9
    assert wrench(0.0)[0] > wrench(0.5)[0] > wrench(1.0)[0]


def test_the_fan_carries_its_jet_along():
    record = fan_record(FAN, VEHICLE.positions, PERIOD)
    record["y"] = 0.7
    out = np.empty(3)
    jet_at(record[0], AXIAL, RADIAL, DISTANCE, 0.7 + 0.3, FAN.height, out)
    np.testing.assert_allclose(out, wind(DISTANCE, 0.3, FAN.height), rtol=1e-12)


def test_the_drag_lies_along_the_wind_that_the_moving_vehicle_meets():
    far = 5.0  # beside the jet
    F = wrench(far, velocity=(1.0, 0.0, 0.0))[:3]
    # four rotors at 0.020 N/(m/s) and the hull's 0.5 rho CdA u^2
    np.testing.assert_allclose(F, [-(4 * 0.020 + 0.5 * 1.2 * 0.060), 0, 0], atol=1e-12)


def test_a_centre_of_mass_off_the_axis_shifts_the_torque():
    centred, shifted = wrench(0.3), wrench(0.3, com=(0.02, 0.01, 0.0))
    world = Rotation.from_euler("z", np.pi).apply([0.02, 0.01, 0.0])
    np.testing.assert_allclose(shifted[3:], centred[3:] - np.cross(world, centred[:3]), atol=1e-12)


def test_the_momentum_flux_is_the_same_at_every_distance():
    r = np.linspace(0, 2.9, 2901)
    flux = [
        trapezoid(2 * np.pi * r * np.array([wind(x, a, FAN.height)[0] ** 2 for a in r]), r)
        for x in (0.4, 1.0, 1.7, 2.3, 3.0)
    ]
    disc = np.pi * (FAN.radius**2 - FAN.hub_radius**2) * FAN.speed**2
    np.testing.assert_allclose(flux, disc, rtol=0.005)


def test_still_air_is_drawn_into_the_jet():
    assert wind(DISTANCE, 1.0, FAN.height)[1] < 0.0
    assert wind(DISTANCE, -1.0, FAN.height)[1] > 0.0
    assert wind(DISTANCE, 0.0, FAN.height + 1.0)[2] < 0.0


@pytest.mark.parametrize("point", [(-1.0, 0.0, 1.2), (2.0, 10.0, 1.2), (50.0, 0.0, 1.2)])
def test_there_is_no_wind_behind_beside_or_far_from_the_fan(point):
    np.testing.assert_array_equal(wind(*point), 0.0)


def test_the_wrench_does_not_depend_on_the_vehicle_s_yaw(profile):
    for y in (0.0, 0.25, 0.5, 0.8):
        turned = np.array([wrench(y, yaw=a) for a in np.linspace(0, 2 * np.pi, 25)])
        assert np.ptp(turned[:, 0]) < 0.003 * profile[:, 0].max()
        assert np.ptp(turned[:, 5]) < 0.02 * profile[:, 5].max()


def gusts(steps, seed=0, fan=None):
    """Gusts (steps, STATIONS, 3) and the stations (STATIONS, 3)."""
    rng = np.random.default_rng(seed)
    record = fan_record(fan or Fan(), VEHICLE.positions, PERIOD)
    f = record[0]
    f["gusts"] = f["mixing"] @ rng.standard_normal((STATIONS, 3))
    out = np.empty((steps, STATIONS, 3))
    for k in range(steps):
        gust(f, rng.standard_normal(3 * STATIONS))
        out[k] = f["gusts"]
    return out, f["stations"].copy()


@pytest.fixture(scope="module")
def long_gusts():
    return gusts(120_000)


def test_gusts_have_unit_variance_and_no_mean(long_gusts):
    samples, _ = long_gusts
    # 600 s of gusts that last 0.1 s: 3000 independent samples
    np.testing.assert_allclose(samples.var(axis=0), 1.0, atol=0.12)
    np.testing.assert_allclose(samples.mean(axis=0), 0.0, atol=0.08)


def test_gusts_are_correlated_over_a_quarter_of_a_metre(long_gusts):
    samples, places = long_gusts
    distance = np.linalg.norm(places[:, None] - places[None], axis=2)
    for axis in range(3):
        np.testing.assert_allclose(
            np.corrcoef(samples[:, :, axis].T), np.exp(-distance / 0.25), atol=0.09
        )


def test_gusts_last_for_the_stated_time(long_gusts):
    samples, _ = long_gusts
    x = samples[:, :, 0]
    for lag in (4, 20, 40):
        correlation = np.mean(x[lag:] * x[:-lag]) / np.mean(x * x)
        assert correlation == pytest.approx(np.exp(-lag * PERIOD / 0.10), abs=0.04)


def test_stations_lie_on_the_rotors_and_round_the_hull(long_gusts):
    _, places = long_gusts
    np.testing.assert_array_equal(places[:4], VEHICLE.positions)
    np.testing.assert_allclose(np.linalg.norm(places[4:], axis=1), HULL_RADIUS)
