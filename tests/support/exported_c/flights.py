"""Five flights for C and Python: numbers as single precision holds them."""

import math
from dataclasses import replace

import numpy as np
from numpy.random import default_rng

from tests.support.flown import noisy
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.effects import parse_setting
from windwrench.envs.recording import record_flight

# name: vehicle, trajectory, declared effects, centre of mass (m), rows of the flight between poses
FLIGHTS = {
    "ardrone2, turning": ("ardrone2", "yaw", (), (0.0, 0.0, 0.0), 1),
    "crazyflie, brisk": ("crazyflie", "fast", (), (0.0, 0.0, 0.0), 1),
    "hummingbird, centre of mass off": ("hummingbird", "excite", (), (0.01, -0.005, 0.02), 1),
    "ardrone2, four effects": (
        "ardrone2",
        "excite",
        ("motor_lag", "rotor_drag", "body_drag", "inflow_thrust"),
        (0.0, 0.0, 0.0),
        1,
    ),
    "crazyflie, 50 poses a second": ("crazyflie", "circle", (), (0.0, 0.0, 0.0), 4),
}


def vehicle_of(name):
    """Return the vehicle that flies a flight."""
    vehicle, _, effects, com, every = FLIGHTS[name]
    model = replace(load_vehicle(vehicle), com=np.array(com))
    rate = replace(model.mocap, rate_hz=200.0 / every)
    return replace(model, mocap=rate).with_effects(*(parse_setting(e, model) for e in effects))


def flight(name, steps, seed=0, imu=False, noise=1.0):
    """Return ``dt`` (n,), ``rotor_speeds`` (n, 4), ``position`` (n, 3), ``quaternion`` (n, 4), and
    with an IMU ``gyro`` and ``accelerometer`` (n, 3); what was not measured is NaN.

    Steps are uneven by 2 %. ``noise`` is that of poses in declared deviations, at least one.
    """
    vehicle, trajectory, _, com, every = FLIGHTS[name]
    model = replace(load_vehicle(vehicle), com=np.array(com))
    log = record_flight(
        model, vehicle_of(name).effects, trajectory, max(0.1, steps * every / 200.0), seed, imu=imu
    )
    rng = default_rng(seed)
    rows = slice(0, steps * every, every)
    position = log["position"][rows].copy()
    quaternion = log["quaternion"][rows].copy()
    n = len(position)
    period = every / 200.0
    if noise > 1.0:
        more = math.sqrt(noise * noise - 1.0)
        again = default_rng((seed, 1))
        position, quaternion = noisy(model.mocap, again, position, quaternion, more, more)
    out = {
        "dt": period * (1.0 + 0.02 * rng.uniform(-1.0, 1.0, n)),
        "rotor_speeds": log["rotor_speeds"][rows],
        "position": position,
        "quaternion": quaternion,
    }
    if imu:
        for key, noise, bias in (("gyro", 0.005, 0.02), ("accelerometer", 0.05, 0.1)):
            out[key] = log[key][rows] + bias * rng.uniform(-1.0, 1.0, 3)
            out[key] += noise * rng.standard_normal((n, 3))
        _saturate(rng, out["accelerometer"])
    return {key: np.asarray(value, dtype=np.float32).astype(float) for key, value in out.items()}


def _saturate(rng, accelerometer):
    """Let the accelerometer shake and saturate now and then, for up to 0.8 s."""
    for begin in np.flatnonzero(rng.random(len(accelerometer)) < 0.001):
        rows = slice(begin, begin + int(rng.integers(1, 160)))
        accelerometer[rows] = np.clip(8.0 * accelerometer[rows], -39.0, 39.0)
