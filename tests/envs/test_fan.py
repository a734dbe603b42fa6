"""The fan's jet: what flow it is, and what it does to a vehicle in it."""

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.spatial.transform import Rotation

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.mean_jet import jet_table
from windwrench.envs.fan import Fan, fan_record, jet_at, jet_wrench

VEHICLE = load_vehicle("ardrone2")
PERIOD = 0.005
FAN = Fan(turbulence=0.0)
JET = np.stack(jet_table(FAN.radius, FAN.hub_radius))
DISTANCE = 2.3


def wind(x, y, z, fan=FAN):
    out = np.full(3, np.nan)
    jet_at(fan_record(fan, VEHICLE.positions, PERIOD)[0], *JET, x, y, z, out)
    return out


def wrench(
    y, x=DISTANCE, z=FAN.height, yaw=np.pi, fan=FAN, velocity=(0.0, 0.0, 0.0), com=(0.0, 0.0, 0.0)
):
    """Force and torque (6,), world, on a level vehicle that faces the fan."""
    out = np.full(6, np.nan)
    jet_wrench(
        fan_record(fan, VEHICLE.positions, PERIOD)[0],
        JET,
        np.array([x, y, z]),
        Rotation.from_euler("z", yaw).as_matrix(),
        np.array([*velocity, 0.0, 0.0, 0.0]),
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


def test_the_drag_lies_along_the_wind_that_the_moving_vehicle_meets():
    far = 5.0  # beside the jet
    F = wrench(far, velocity=(1.0, 0.0, 0.0))[:3]
    # four rotors at 0.020 N/(m/s) and the hull's 0.5 rho CdA u^2
    np.testing.assert_allclose(F, [-(4 * 0.020 + 0.5 * 1.2 * 0.060), 0, 0], atol=1e-12)


def test_the_momentum_flux_is_the_same_at_every_distance():
    r = np.linspace(0, 2.9, 2901)
    flux = [
        trapezoid(2 * np.pi * r * np.array([wind(x, a, FAN.height)[0] ** 2 for a in r]), r)
        for x in (0.4, 1.0, 1.7, 2.3, 3.0)
    ]
    disc = np.pi * (FAN.radius**2 - FAN.hub_radius**2) * FAN.speed**2
    np.testing.assert_allclose(flux, disc, rtol=0.005)


def test_the_wrench_does_not_depend_on_the_vehicle_s_yaw(profile):
    for y in (0.0, 0.25, 0.5, 0.8):
        turned = np.array([wrench(y, yaw=a) for a in np.linspace(0, 2 * np.pi, 25)])
        assert np.ptp(turned[:, 0]) < 0.003 * profile[:, 0].max()
        assert np.ptp(turned[:, 5]) < 0.02 * profile[:, 5].max()
