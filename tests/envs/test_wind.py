"""Winds and the fan's jet: spectra against theory, formulas, files, and the jet's wrench."""

import math
from math import nan, pi

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal, assert_equal
from scipy.integrate import trapezoid
from scipy.spatial.transform import Rotation

from tests.support.outcomes import refused
from windwrench import _core
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.mean_jet import AIR_DENSITY, jet_table
from windwrench.envs.fan import Fan, fan_record
from windwrench.envs.wind import (
    FanWall,
    Gust,
    Shear,
    Turbulence,
    Uniform,
    VehicleWash,
    Wind,
    low_altitude,
    on_grid,
    read_wind,
    spectrum,
    write_wind,
)

FOOT = 0.3048
LINE = 0.25 * np.arange(512)  # m


def measured_spectra(fields, heading):
    """Wave numbers, and the mean one-sided spectrum (n, 3) of the components of fields, in axes of
    which the first is ``heading``, along a line in that direction.
    """
    along = np.array([math.cos(heading), math.sin(heading), 0.0])
    axes = np.array([along, [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
    points = LINE[:, None] * along
    window = np.hanning(len(LINE))[:, None]
    power = np.zeros((len(LINE) // 2 + 1, 3))
    for field in fields:
        values = field.velocity(points, 0.0) @ axes.T
        power += abs(np.fft.rfft(window * values, axis=0)) ** 2
    power *= LINE[1] / (math.pi * np.sum(window**2) * len(fields))
    return 2 * math.pi * np.fft.rfftfreq(len(LINE), LINE[1]), power


@pytest.mark.parametrize(
    ("form", "case"), [("dryden", "near the ground"), ("von-karman", "one length")]
)
def test_spectra_along_the_mean_wind_are_those_of_the_specification(form, case):
    heading = 0.6
    mean = 5.0 * np.array([math.cos(heading), math.sin(heading), 0.0])
    sigma, length = (
        (np.full(3, 1.2), np.full(3, 4.0)) if case == "one length" else low_altitude(5.0, 6.0)
    )
    fields = [Turbulence(k, sigma, length, mean, form, modes=40, smallest=0.1) for k in range(500)]
    omega, power = measured_spectra(fields, heading)
    for axis in range(3):
        theory = spectrum(
            form, "along" if axis == 0 else "across", omega, sigma[axis], length[axis]
        )
        # bands between what a line of 128 m and points 0.25 m apart show
        for low, high in ((0.2, 0.5), (0.5, 1.2), (1.2, 3.0), (3.0, 7.0)):
            band = (omega >= low) & (omega < high)
            ratio = power[band, axis].mean() / theory[band].mean()
            assert ratio == pytest.approx(1.0, abs=0.15), (axis, low)


def test_low_altitude_is_the_specification_s_worked_out():
    sigma, length = low_altitude(100 * FOOT, 10.0)
    part = 0.177 + 0.0823
    assert_allclose(sigma, [1.0 / part**0.4, 1.0 / part**0.4, 1.0])
    assert_allclose(length / FOOT, [100 / part**1.2, 100 / part**1.2, 100.0])
    assert_array_equal(low_altitude(0.5, 3.0)[1], low_altitude(10 * FOOT, 3.0)[1])


def test_the_air_keeps_its_volume():
    field = Turbulence(1, 1.0, 2.0, (4, 0, 0))
    step = 1e-4
    points = default_rng(1).uniform(-2, 2, (10, 3))
    slopes = [
        (field.velocity(points + d, 0.0) - field.velocity(points - d, 0.0))[:, i] / (2 * step)
        for i, d in enumerate(step * np.eye(3))
    ]
    assert abs(np.sum(slopes, axis=0)).max() < 1e-5 * np.abs(slopes).max() + 1e-5


def test_shear_grows_with_height():
    points = np.array([[0, 0, h * FOOT] for h in (0.1, 3.0, 20.0, 200.0)])
    log = Shear((0, 5.0, 0), law="log").velocity(points, 0.0)
    above = np.log(np.maximum(points[:, 2] / FOOT, 0.15) / 0.15)
    assert_allclose(log[:, 1], 5.0 * above / math.log(20 / 0.15), atol=1e-12)
    power = Shear((5.0, 0, 0), reference=10.0, law="power", exponent=0.2)
    assert_allclose(power.velocity(points, 0.0)[:, 0], 5.0 * (points[:, 2] / 10) ** 0.2)


def test_a_gust_comes_and_goes_by_its_cosine():
    given = {"start": 1.0, "speed": 4.0, "direction": (1, 0, 0)}
    for falls, last in ((True, 0), (False, 1)):
        gust = Gust((0, 0, -2.0), 3.0, **given, falls=falls)
        seen = [gust.velocity([[2, 7, 1]], t)[0, 2] for t in (1.0, 1.5, 1.875, 2.25, 3.2)]
        assert_allclose(seen, np.multiply(-2.0, [0, 0, 0.5, 1, last]), atol=1e-12)


def test_one_fan_of_a_wall_is_the_fan_of_the_environment():
    wall = FanWall([FAN.speed], 1, 1, radius=FAN.radius, hub_radius=FAN.hub_radius, turbulence=0.0)
    points = default_rng(3).uniform([0.1, -1.5, 0.0], [6.0, 1.5, 2.5], (50, 3))
    expected = [wind(*point) for point in points]
    assert_allclose(wall.velocity(points, 3.0), expected, atol=1e-12)


def test_a_wall_adds_momentum_and_turns_with_its_direction():
    def blown(speeds, point=(2.0, 0.4, 0.9), **given):
        wall = FanWall([*speeds, 0, 0, 0, 0], 2, 3, turbulence=0.0, **given)
        return wall.velocity([point], 0.0)[0]

    one = blown((4, 0))
    other = blown((0, 3))
    both = blown((4, 3))
    assert both[0] == pytest.approx(math.hypot(one[0], other[0]))
    assert_allclose(both[1:], one[1:] + other[1:])
    turned = blown((4, 3), (-0.4, 2.0, 0.9), direction=(0, 1, 0))
    assert_allclose(turned, [-both[1], both[0], both[2]], atol=1e-12)


def test_a_wash_carries_its_vehicle():
    # the momentum flux through a plane below is the thrust
    wash = VehicleWash((0, 0, 3.0), thrust=5.0, turbulence=0.0)
    for below in (0.6, 1.5):
        r = np.linspace(0.0, 2.9, 1000)
        points = np.column_stack([r, 0 * r, np.full_like(r, 3.0 - below)])
        down = wash.velocity(points, 0.0)[:, 2]
        flux = AIR_DENSITY * np.trapezoid(down**2 * 2 * math.pi * r, r)
        assert flux == pytest.approx(5.0, rel=0.02)
        assert down.max() <= 0.0


def test_winds_add_up():
    parts = Uniform((1, 2, 3)), Shear((4, 0, 0)), Turbulence(0, 1.0, 2.0, (4, 0, 0))
    points = default_rng(5).uniform(-2, 2, (4, 3))
    whole = parts[0] + parts[1] + parts[2]
    assert isinstance(whole, Wind)
    assert_allclose(
        whole.velocity(points, 0.3), sum(p.velocity(points, 0.3) for p in parts), atol=1e-12
    )


class Vortex:
    """A wind of one's own: linear in place and time, so that a grid holds it exactly."""

    def velocity(self, points, time):
        p = np.asarray(points)
        return np.column_stack([-p[:, 1] * (1 + time), p[:, 0], 0.5 * p[:, 2] - time])


def test_a_wind_of_one_s_own_flies_as_a_grid():
    grid = on_grid(Vortex(), (-1, -1, 0), (1, 1.1, 2), 0.5, times=[0.0, 1.0, 2.0])
    points = default_rng(6).uniform([-1, -1, 0], [1, 1.1, 2], (30, 3))
    for there, at, when in (
        *((points, points, (time, time)) for time in (0.0, 0.3, 1.7)),
        ([[5.0, 0.0, 1.0]], [[1.0, 0.0, 1.0]], (9.0, 2.0)),  # beyond the ends
    ):
        seen = grid.velocity(there, when[0])
        assert_allclose(seen, Vortex().velocity(at, when[1]), atol=1e-12)


@pytest.mark.parametrize("kind", [".npz", ".nc"])
def test_a_grid_comes_back_from_its_file(tmp_path, kind):
    if kind == ".nc":
        pytest.importorskip("xarray", reason="xarray is not installed: pip install xarray")
    grid = on_grid(Vortex(), (-1, -1, 0), (1, 1, 2), 0.5, times=[0.0, 1.0])
    again = read_wind(write_wind(grid, tmp_path / f"wind{kind}"))
    assert_equal((again.wind, *again.axes), (grid.wind, *grid.axes))


def test_a_netcdf_of_another_order_and_without_a_time_is_read(tmp_path):
    xarray = pytest.importorskip("xarray", reason="xarray is not installed: pip install xarray")
    axes = {"z": [0.0, 1.0], "y": [0.0, 1.0, 2.0], "x": [0.0, 0.5, 1.0, 1.5]}
    u = np.arange(24.0).reshape(2, 3, 4)
    data = xarray.Dataset({n: (("z", "y", "x"), k * u) for k, n in enumerate("uvw")}, coords=axes)
    data.to_netcdf(tmp_path / "a.nc")
    wind = read_wind(tmp_path / "a.nc")
    assert_allclose(wind.velocity([[1.5, 1.0, 1.0]], 4.0), [[0.0, 19.0, 38.0]])


def test_a_file_that_lacks_an_axis_or_numbers_is_named(tmp_path):
    """Golden lines hold what is none at all."""
    whole = {"x": [0, 1], "y": [0], "z": [0], "wind": np.zeros((1, 3, 1, 1, 3))}
    for arrays, said in (({"x": [0.0]}, "lacks 'y'"), (whole, "must have the shape")):
        np.savez(tmp_path / "a.npz", **arrays)
        with refused(rf"{tmp_path}/a\.npz.*{said}"):
            read_wind(tmp_path / "a.npz")


FAN = Fan(turbulence=0.0)
RECORD = fan_record(FAN, load_vehicle("ardrone2").positions, 0.005)
JET = np.stack(jet_table(FAN.radius, FAN.hub_radius))


def wind(x, y, z):
    out = np.full((1, 3), nan)
    _core.jet_at(RECORD.ctypes.data, JET, np.array([[x, y, z]]), out)
    return out[0]


def wrench(y, yaw=pi, velocity=(0.0, 0.0, 0.0)):
    """Force and torque (6,), world, on a level vehicle at 2.3 m that faces the fan."""
    out = np.full(6, nan)
    place = np.array([2.3, y, FAN.height])
    attitude = Rotation.from_euler("z", yaw).as_matrix()
    motion = np.array([*velocity, 0, 0, 0.0])
    _core.jet_wrench(RECORD.ctypes.data, JET, place, attitude, motion, np.zeros(3), out)
    return out


def test_the_drag_lies_along_the_wind_that_the_moving_vehicle_meets():
    far = 5.0  # beside the jet
    F = wrench(far, velocity=(1.0, 0.0, 0.0))[:3]
    # four rotors at 0.020 N/(m/s) and the hull's 0.5 rho CdA u^2
    assert_allclose(F, [-(4 * 0.020 + 0.5 * 1.2 * 0.060), 0, 0], atol=1e-12)


def test_the_momentum_flux_is_the_same_at_every_distance():
    r = np.linspace(0, 2.9, 2901)
    flux = [
        trapezoid(2 * pi * r * np.array([wind(x, a, FAN.height)[0] ** 2 for a in r]), r)
        for x in (0.4, 1.0, 1.7, 2.3, 3.0)
    ]
    disc = pi * (FAN.radius**2 - FAN.hub_radius**2) * FAN.speed**2
    assert_allclose(flux, disc, rtol=0.005)


def test_the_wrench_does_not_depend_on_the_vehicle_s_yaw():
    profile = np.array([wrench(y) for y in np.linspace(-1.2, 1.2, 241)])
    for y in (0.0, 0.25, 0.5, 0.8):
        turned = np.array([wrench(y, yaw=a) for a in np.linspace(0, 2 * pi, 25)])
        assert np.ptp(turned[:, 0]) < 0.003 * profile[:, 0].max()
        assert np.ptp(turned[:, 5]) < 0.02 * profile[:, 5].max()
