"""What the wrench filter would show of a moving fan, by the model that the trackers' documentation
states, tick by tick: an independent reference for their faster one.
"""

import numpy as np
import scipy.linalg
import scipy.signal

from windwrench.controllers.flight import FlightGains
from windwrench.controllers.jet_map import COUNT, FIRST, STEP, jet_map
from windwrench.controllers.observation import FORCE_X, FORCE_Y, OBSERVATION_SIZE, TORQUE_Z

TICKS = 16


def kalman_gain(inertia, white, walk, measured, period):
    """A step of (place, rate, wrench), and the gain that a Kalman filter of it converges to."""
    A = np.array([[1.0, period, 0.0], [0.0, 1.0, period / inertia], [0.0, 0.0, 1.0]])
    Q = np.diag([0.0, (period / inertia * white) ** 2, walk**2])
    P = scipy.linalg.solve_discrete_are(A.T, np.eye(3)[:, :1], Q, [[measured**2]])
    return A, P[:, 0] / (P[0, 0] + measured**2)


def estimated(wrench, inertia, noise, measured, period, rng):
    """Run that filter on the motion that a true wrench (n, ticks) makes; return its wrench."""
    A, K = kalman_gain(inertia, *noise, measured, period)
    x = np.zeros((len(wrench), 3))
    guess = np.zeros((len(wrench), 3))
    guess[:, 2] = wrench[:, 0]
    out = np.empty_like(wrench)
    for k in range(wrench.shape[1]):
        x[:, 2] = wrench[:, k]
        x = x @ A.T
        guess = guess @ A.T
        seen = x[:, 0] + measured * rng.standard_normal(len(x))
        guess = guess + np.outer(seen - guess[:, 0], K)
        out[:, k] = guess[:, 2]
    return out


def lasting(rng, shape, time, period):
    """Noise of unit variance (n, ticks) that lasts over ``time`` s."""
    keep = np.exp(-period / time)
    drawn = rng.standard_normal(shape)
    drawn[:, 1:] *= np.sqrt(1 - keep**2)
    return scipy.signal.lfilter([1.0], [1.0, -keep], drawn)


def observations(fan, briefing, rng, settle=300, turns=True):
    """Observations (n, decisions, 8) of a vehicle that hovers at 0 while the fan is at ``fan`` (n,
    ticks) m; before them the filter settles. Unless it ``turns``, it holds its yaw whatever comes.
    """
    air = briefing.air
    noise = briefing.noise
    vehicle = briefing.vehicle
    fan = np.concatenate([np.repeat(fan[:, :1], settle, axis=1), fan], axis=1)
    tables = jet_map(vehicle, briefing.jet, air)
    offsets = FIRST + STEP * np.arange(COUNT)
    felt = [np.interp(-fan, offsets, tables.mean[a]) for a in range(3)]
    size = (air.disturbance_torque, air.disturbance_force, air.disturbance_force)
    for a in range(3):
        gust = np.sqrt(np.interp(-fan, offsets, tables.gust[a]))
        felt[a] = (
            felt[a]
            + size[a] * lasting(rng, fan.shape, air.disturbance_time, noise.period)
            + gust * lasting(rng, fan.shape, air.gust_time, noise.period)
        )
    # the vehicle yaws under the torque, and its stations move against the jet
    gains = FlightGains()
    inertia = vehicle.inertia[2, 2]
    A = np.zeros((4, 4))
    A[0, 1] = A[1, 2] = 1.0
    A[2] = -gains.yaw_integral, -gains.yaw, -gains.yaw_rate, 1.0 / inertia
    turn = scipy.linalg.expm(noise.period * A)[:3]
    yaw = np.zeros((len(fan), 3))
    for k in range(fan.shape[1] if turns else 0):
        for a in range(3):
            felt[a][:, k] += yaw[:, 2] * np.interp(-fan[:, k], offsets, tables.turning[a])
        yaw = np.column_stack([yaw, felt[0][:, k]]) @ turn.T
    out = np.zeros((len(fan), (fan.shape[1] - settle) // TICKS, OBSERVATION_SIZE))
    axes = (
        (TORQUE_Z, inertia, (noise.torque, noise.torque_walk), noise.attitude),
        (FORCE_X, vehicle.mass, (noise.thrust, noise.force_walk), noise.position),
        (FORCE_Y, vehicle.mass, (noise.thrust, noise.force_walk), noise.position),
    )
    for (column, inert, walk, measured), wrench in zip(axes, felt, strict=True):
        shown = estimated(wrench, inert, walk, measured, noise.period, rng)
        out[:, :, column] = shown[:, settle - 1 :: TICKS][:, : out.shape[1]]
    return out
