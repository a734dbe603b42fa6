"""Flights with a rotor that loses thrust at a random time, of vehicles drawn at random.

A rigid body at 1 kHz and a flight loop at 250 Hz of its own: nothing of the plant or of the search
is in it. It has what the search does not model: motors whose speed lags and not their thrust, a
dead zone, drag, gusts that correlate, a centre of mass that is off, gyro bias, delay, saturation,
ground.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from windwrench.identification.comparison.fault_channels import Channels
from windwrench.runtime.compiled import compiled

Array = NDArray[np.float64]

_STEP = 0.001  # s
_LOOP = 4  # steps between two of the flight loop's
_G = 9.81
_SIGNS = np.array([[1, 1, -1, -1], [-1, 1, 1, -1], [1, -1, 1, -1]], dtype=np.float64)
EVENTS = ("fault", "none", "other")


@dataclass(frozen=True, eq=False)
class Drawn:
    """A flight, and what is true of it."""

    channels: Channels
    event: str  # one of EVENTS
    rotor: int  # 1 to 4; 0: none
    onset: float  # s
    loss: float  # share of the rotor's thrust
    seen: float  # s of log after the onset


def draw_flight(seed: int, event: str) -> Drawn:
    """Fly a vehicle drawn at random; ``event`` is one of EVENTS: a rotor loses thrust, nothing
    happens, or a force and a torque begin that no rotor makes.
    """
    rng = np.random.default_rng([seed, EVENTS.index(event)])
    mass = np.exp(rng.uniform(np.log(0.03), np.log(3.0)))
    arm = 0.0325 * (mass / 0.03) ** (1 / 3)
    inertia = mass * np.square(0.62 * arm * rng.uniform(0.85, 1.2, 3) * [1.0, 1.0, 1.45])
    yaw = 0.12 * arm * rng.uniform(0.6, 1.6)  # m, torque to thrust
    ratio, bend, dead = rng.uniform(1.8, 4.0), rng.uniform(0.0, 1.0), rng.uniform(0.0, 0.1)
    lag = rng.uniform(0.015, 0.06)
    seconds = rng.uniform(12.0, 22.0)
    onset = rng.uniform(6.0, seconds - 0.5)
    rotor, loss = int(rng.integers(4)), float(np.exp(rng.uniform(np.log(0.05), 0.0)))
    count = round(seconds / _STEP)
    lively = rng.choice([0.0, 0.1, 0.35])  # rad, of the attitudes that are flown
    t = _STEP * np.arange(count)
    asked = np.zeros((count, 3))
    for axis in range(3):
        for _ in range(3):
            size = lively * (0.5 if axis < 2 else 1.0)
            asked[:, axis] += size * np.sin(
                2 * np.pi * rng.uniform(0.1, 0.9) * t + rng.uniform(0.0, 2 * np.pi)
            )
    gust = np.column_stack(
        [
            _ou(rng, count, rng.uniform(0.2, 0.8), size)
            for size in [rng.uniform(0.02, 0.5)] * 3 + [rng.uniform(0.1, 1.5)] * 3
        ]
    )  # m/s2 and rad/s2
    if event == "other":
        gust[t >= onset] += rng.normal(0.0, [1.0, 1.0, 3.0, 8.0, 8.0, 2.0])
    states, inputs = _fly(
        *(inertia / (mass * arm), yaw / arm, np.array([ratio, bend, dead, lag])),
        *(asked, gust, rng.standard_normal((count // _LOOP + 1, 3))),
        *(round(onset / _STEP), rotor if event == "fault" else -1, loss),
        *(rng.normal(0.0, 0.02, 2), rng.uniform(0.002, 0.01)),
    )
    return _log(rng, states, inputs, event, rotor, onset, loss)


def _log(
    rng: np.random.Generator,
    states: Array,
    inputs: Array,
    event: str,
    rotor: int,
    onset: float,
    loss: float,
) -> Drawn:
    """Return what an autopilot would have written of a flight."""
    every = int(rng.choice([4, 5]))
    t = np.asarray(_STEP * np.arange(len(states)), dtype=np.float64)
    imu = slice(None, None, every)
    count = len(t[imu])
    gyro = states[imu, :3] + rng.normal(0.0, 0.02, 3)
    gyro += rng.uniform(0.002, 0.015) * rng.standard_normal((count, 3))
    limit = float(rng.choice([500.0, 2000.0])) * np.pi / 180.0
    force = states[imu, 3:6] + rng.normal(0.0, 0.1, 3)
    force += rng.uniform(0.03, 0.4) * rng.standard_normal((count, 3))
    slow = int(rng.choice([4, 4, 20, 50, 100]))  # ms between logged commands
    late = int(rng.integers(0, 6))  # ms
    command = slice(None, None, slow)
    channels = Channels(
        f"{event} {rotor + 1}",
        t[imu],
        np.clip(gyro, -limit, limit),
        t[imu],
        force,
        t[command] + _STEP * late,
        np.round(1000.0 * inputs[command]) / 1000.0,
    )
    happened = event != "none"
    return Drawn(
        channels,
        event,
        rotor + 1 if event == "fault" else 0,
        onset if happened else np.nan,
        loss if event == "fault" else 0.0,
        float(t[-1] - onset) if happened else 0.0,
    )


def _ou(rng: np.random.Generator, count: int, time: float, size: float) -> Array:
    """Return an Ornstein-Uhlenbeck process (count,)."""
    from scipy.signal import lfilter

    keep = np.exp(-_STEP / time)
    drive = size * np.sqrt(1.0 - keep * keep) * rng.standard_normal(count)
    found: Array = lfilter([1.0], [1.0, -keep], drive)
    return found


@compiled
def _fly(
    inertia: Array,
    yaw: float,
    motor: Array,
    asked: Array,
    gust: Array,
    normals: Array,
    onset: int,
    rotor: int,
    loss: float,
    offset: Array,
    noise: float,
) -> tuple[Array, Array]:
    """Fly; return angular velocity and specific force (n, 6), and commands (n, 4), until the end or
    half a second after the ground is hit. All in parts of weight and arm; ``inertia`` (3,) s2.
    """
    count = len(asked)
    ratio, bend, dead, lag = motor[0], motor[1], motor[2], motor[3]
    states, inputs = np.zeros((count, 6)), np.zeros((count, 4))
    w, R = np.zeros(3), np.eye(3)
    velocity, height = np.zeros(3), 0.0
    # command in a hover: bend v^2 + (1 - bend) v = 1 / ratio, v above the dead zone
    level = 1.0 / ratio
    v = level
    for _ in range(60):
        v -= (bend * v * v + (1.0 - bend) * v - level) / (2.0 * bend * v + 1.0 - bend)
    hover = dead + v * (1.0 - dead)
    slope = (
        (2.0 * bend * v + 1.0 - bend) * ratio / (1.0 - dead)
    )  # of a rotor's thrust, in its hover
    speed = np.zeros(4)  # square root of thrust, in parts of the hover's
    integral, seen, u = np.zeros(3), np.zeros(3), np.zeros(4)
    climb = 0.0
    keep = np.exp(-0.001 / lag)
    down = 0
    for n in range(count):
        if n % 4 == 0:
            target = min(3.0, 1.5 * 0.001 * n)
            want = 1.2 * (target - height)
            want = min(max(want, -1.0), 1.0) - velocity[2]
            climb = min(max(climb + 0.004 * 0.2 * want, -0.1), 0.1)
            lift = 1.0 + 0.35 * want + climb
            tilt = max(R[2, 2], 0.5)
            k = n // 4
            for i in range(3):
                seen[i] += 0.5 * (w[i] + noise * normals[k, i] - seen[i])
            # attitude error from the body's z axis and a heading that is followed by its rate
            ax, ay = asked[n, 0], asked[n, 1]
            ex = ax - np.arctan2(R[2, 1], max(R[2, 2], 0.2))
            ey = ay - np.arctan2(-R[2, 0], max(R[2, 2], 0.2))
            rates = np.array([7.0 * ex, 7.0 * ey, asked[n, 2]])
            base = hover + (lift / tilt - 1.0) / slope
            torque = np.zeros(3)
            gain = np.array([22.0, 22.0, 6.0])
            for i in range(3):
                error = min(max(rates[i], -4.0), 4.0) - seen[i]
                integral[i] = min(max(integral[i] + 0.004 * 2.0 * error, -2.0), 2.0)
                if n < 1000:
                    integral[i] = 0.0
                share = inertia[i] * gain[i] * (error + integral[i]) / 9.81
                torque[i] = share / slope / (1.0 if i < 2 else yaw)
            torque[2] = min(max(torque[2], -0.15), 0.15)
            for i in range(4):
                part = 0.0
                for j in range(3):
                    part += _SIGNS[j, i] * torque[j]
                u[i] = min(max(base + part, 0.0), 1.0)
        total, tx, ty, tz = 0.0, 0.0, 0.0, 0.0
        for i in range(4):
            x = max(u[i] - dead, 0.0) / (1.0 - dead)
            now = ratio * (bend * x * x + (1.0 - bend) * x)
            speed[i] = np.sqrt(now) + keep * (speed[i] - np.sqrt(now))
            thrust = 0.25 * speed[i] * speed[i]
            if i == rotor and n >= onset:
                thrust *= 1.0 - loss
            total += thrust
            tx += thrust * (_SIGNS[0, i] - offset[1])
            ty += thrust * (_SIGNS[1, i] + offset[0])
            tz += thrust * _SIGNS[2, i] * yaw
        moment = np.array([tx, ty, tz]) * 9.81
        turned = np.zeros(3)
        turned[0] = (moment[0] - (inertia[2] - inertia[1]) * w[1] * w[2]) / inertia[0]
        turned[1] = (moment[1] - (inertia[0] - inertia[2]) * w[2] * w[0]) / inertia[1]
        turned[2] = (moment[2] - (inertia[1] - inertia[0]) * w[0] * w[1]) / inertia[2]
        body = R.T @ velocity
        felt = np.array([-0.4 * body[0], -0.4 * body[1], total * 9.81 - 0.2 * body[2]])
        for i in range(3):
            turned[i] += gust[n, 3 + i] - 0.3 * w[i]
            felt[i] += gust[n, i]
        pull = R @ felt
        pull[2] -= 9.81
        if height <= 0.0 and n < onset and pull[2] <= 0.0 and n < 3000:
            w[:] = 0.0
            velocity[:] = 0.0
            felt[:] = np.array([0.0, 0.0, 9.81])
        else:
            w += 0.001 * turned
            velocity += 0.001 * pull
            height += 0.001 * velocity[2]
            a = 0.001 * w
            spin = np.array([[1.0, -a[2], a[1]], [a[2], 1.0, -a[0]], [-a[1], a[0], 1.0]])
            R = R @ spin
            x = R[:, 0] / np.sqrt((R[:, 0] ** 2).sum())
            y = R[:, 1] - x * (x * R[:, 1]).sum()
            y /= np.sqrt((y * y).sum())
            R[:, 0], R[:, 1] = x, y
            R[0, 2] = x[1] * y[2] - x[2] * y[1]
            R[1, 2] = x[2] * y[0] - x[0] * y[2]
            R[2, 2] = x[0] * y[1] - x[1] * y[0]
            if height <= 0.0 and n > 3000:
                if down == 0:
                    felt[2] += 120.0
                down += 1
                w *= 0.95
                velocity[:] = 0.0
                height = 0.0
                if down > 500:
                    return states[:n], inputs[:n]
        states[n, :3], states[n, 3:] = w, felt
        inputs[n] = u
    return states, inputs
