"""Hostile sequences for C and Python: what vehicles, motion capture and radios do, at its worst."""

from math import nan, pi

import numpy as np
from numpy.linalg import norm
from numpy.random import default_rng

STEPS = 1_000
PERIOD = 0.0055  # s: no bound of the filters is a multiple of it, which rounding alone would decide
KINDS = (
    *("gap", "position only", "attitude only", "jump", "jump for good", "burst", "inverted"),
    *("tilted", "random attitudes", "random poses", "frozen", "not a number", "rotors", "off"),
)


def hostile(vehicle, seed):
    """Return a hover (``STEPS`` rows, as of ``flights.flight``) to which something happens every
    half a second: for 5 ms to 0.6 s, 1 cm to 30 m far. Signs of quaternions change at random.
    """
    rng = default_rng(seed)
    position = np.array([0.0, 0.0, 1.2]) + 0.001 * rng.standard_normal((STEPS, 3))
    quaternion = np.array([1.0, 0.0, 0.0, 0.0]) + 0.002 * rng.standard_normal((STEPS, 4))
    speeds = vehicle.hover_rate * (1.0 + 0.01 * rng.standard_normal((STEPS, 4)))
    first = 100
    while first < STEPS:
        last = min(first + int(rng.integers(1, 120)), STEPS)
        befall(str(rng.choice(KINDS)), slice(first, last), position, quaternion, speeds, rng)
        first = last + int(rng.integers(20, 200))
    quaternion /= norm(quaternion, axis=1, keepdims=True)
    quaternion *= rng.choice([-1.0, 1.0], (STEPS, 1))
    flown = {
        "dt": np.full(STEPS, PERIOD),
        "rotor_speeds": speeds,
        "position": position,
        "quaternion": quaternion,
        "gyro": 0.005 * rng.standard_normal((STEPS, 3)),
        "accelerometer": [0.0, 0.0, vehicle.gravity] + 0.05 * rng.standard_normal((STEPS, 3)),
    }
    return {name: values.astype(np.float32).astype(np.float64) for name, values in flown.items()}


def befall(kind, when, x, q, W, rng, size=None):
    """Let something happen to positions (n, 3), quaternions (n, 4) or rotor speeds (n, 4); return
    how far positions jump (3,), where they do: by ``size`` m, or at random; as many rad is a tilt.
    """
    count = when.stop - when.start
    away = rng.standard_normal(3)
    away *= (10.0 ** rng.uniform(-2.0, 1.5) if size is None else size) / norm(away)
    if kind in ("gap", "attitude only"):
        x[when] = nan
    if kind in ("gap", "position only"):
        q[when] = nan
    if kind in ("jump", "jump for good", "burst"):
        x[{"jump": when.start, "burst": when}.get(kind, slice(when.start, None))] += away
    elif kind == "back and forth":
        x[when][1::2] += away
    elif kind in ("inverted", "tilted"):
        half = 0.5 * (pi if kind == "inverted" else size or rng.uniform(0.0, pi))
        q[when] = np.cos(half), np.sin(half), 0.0, 0.0
    elif kind in ("random attitudes", "random poses"):
        q[when] = rng.standard_normal((count, 4))
        x[when] += (kind == "random poses") * (size or 1.0) * rng.standard_normal((count, 3))
    elif kind == "frozen":
        x[when] = x[when.start]
        q[when] = q[when.start]
    elif kind == "not a number":
        for values in (x, q, W):
            values[when][rng.random((count, values.shape[1])) < 0.2] = nan
    elif kind in ("rotors", "off"):
        W[when] *= 0.0 if kind == "off" else rng.uniform(0.0, 1.5, (count, 4))
    return away
