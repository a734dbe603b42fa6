"""Flying a trajectory in the plant and keeping what a flight log holds."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..dynamics.vehicle import EffectSetting, Vehicle
from ..runtime.arrays import Array
from ..runtime.errors import InputError, unknown_name
from .closed_loop import ClosedLoop
from .fan import Fan
from .plant import NOISE, TICK, PlantSettings

_RAMP = 2.0  # s, over which a trajectory fades in
_REPORTED = 4_000  # ticks between two reports of progress
_REACH = 1.5  # m, to either side of a fan's axis
_HOVERS = 21  # at most, on a line
_CEILING = 2.6  # m, of a room without a stated ceiling

# Weak background turbulence: 15 mN and 0.3 mNm over 0.25 s for a 0.46 kg vehicle
BACKGROUND = PlantSettings(
    disturbance_force=0.015, disturbance_torque=0.0003, disturbance_time=0.25
)


# standard deviation (m or rad), and the slowest and the fastest frequency (Hz), of waves
_Wave = tuple[float, float, float]
_DRIFT: _Wave = 0.3, 0.05, 0.2
_Draw = Callable[[np.random.Generator, Array, float], Array]  # from times (n,) s and a ceiling, m


def _waves(rng: np.random.Generator, t: Array, wave: _Wave) -> Array:
    """Return a sum (n,) of four sines with random phases and frequencies."""
    size, slowest, fastest = wave
    frequency, phase = rng.uniform(slowest, fastest, 4), rng.uniform(0, 2 * math.pi, 4)
    sines = np.sin(2 * math.pi * frequency * t[:, None] + phase).sum(axis=1)
    return np.asarray(size * math.sqrt(0.5) * sines)


def _path_of_waves(centre: Sequence[float], waves: Sequence[_Wave]) -> _Draw:
    """Return a draw of x, y, z (m) and yaw (rad) as waves about a centre (4,)."""

    def draw(rng: np.random.Generator, t: Array, ceiling: float) -> Array:
        columns = [at + _waves(rng, t, wave) for at, wave in zip(centre, waves, strict=True)]
        return np.stack(columns, axis=1)

    return draw


def _drifting(rng: np.random.Generator, t: Array, height: Array) -> Array:
    x, y, yaw = (_waves(rng, t, _DRIFT) for _ in range(3))
    return np.stack([x, y, height, yaw], axis=1)


def _ground(rng: np.random.Generator, t: Array, ceiling: float) -> Array:
    return _drifting(rng, t, 0.13 + 0.5 * np.sin(math.pi * t / rng.uniform(5.0, 7.0)) ** 2)


def _ceiling(rng: np.random.Generator, t: Array, ceiling: float) -> Array:
    gap = 0.3 + 0.5 * np.cos(math.pi * t / rng.uniform(5.0, 7.0)) ** 2
    return _drifting(rng, t, ceiling - gap)


def _across(x: Array, y: Array) -> Array:
    """Return a path (n, 4) of places in the plane of a fan's axis, facing the fan."""
    return np.stack([x, y, np.full(len(x), 1.2), np.full(len(x), math.pi)], axis=1)


def _hovers(rows: Sequence[float]) -> _Draw:
    """Return a draw of hovers on lines across a jet, to and fro, ``rows`` (m) farther from the fan.
    Each hover takes 6 s or more, of which 1 s or more is the way from the one before.
    """

    def draw(rng: np.random.Generator, t: Array, ceiling: float) -> Array:
        each = min(max(2, int((t[-1] - _RAMP) / (6.0 * len(rows)))), _HOVERS)
        line = np.linspace(-_REACH, _REACH, each)
        y = np.concatenate([line[:: (-1) ** i] for i in range(len(rows))])
        time = (t[-1] - _RAMP) / len(y)  # s, of a hover
        way = min(time, max(1.0, 4.0 * _REACH / (each - 1)))  # s, of it
        count = np.clip((t - _RAMP) / time, 0.0, len(y))
        k = np.minimum(count.astype(int), len(y) - 1)
        share = np.minimum((count - k) * time / way, 1.0)
        share *= share * (3.0 - 2.0 * share)
        places = _across(np.repeat(rows, each), y)
        before = places[np.maximum(k - 1, 0)]
        return np.asarray(before + share[:, None] * (places[k] - before))

    return draw


def _sweep(rng: np.random.Generator, t: Array, ceiling: float) -> Array:
    """Return sweeps across a jet at about 0.1 m/s."""
    legs = max(1, round(0.1 * (t[-1] - _RAMP) / (2.0 * _REACH)))
    share = legs * np.clip((t - _RAMP) / (t[-1] - _RAMP), 0.0, 1.0)
    y = _REACH * (1.0 - 2.0 * np.abs(1.0 - np.mod(share, 2.0)))
    return _across(np.zeros(len(t)), y)


def _yaw(rng: np.random.Generator, t: Array, ceiling: float) -> Array:
    rate = rng.uniform(1.0, 2.0) * rng.choice([-1.0, 1.0])
    x, y, z = 0.8 * np.sin(0.9 * t), 0.6 * np.sin(1.3 * t), 1.2 + 0.15 * np.sin(0.7 * t)
    return np.stack([x, y, z, rate * t], axis=1)


def _circle(rng: np.random.Generator, t: Array, ceiling: float) -> Array:
    rate = rng.uniform(1.2, 1.8)
    return np.stack([np.cos(rate * t), np.sin(rate * t), 0 * t + 1.2, 0 * t], axis=1)


# In this order. Hover at 1.2 m; slow waves; waves up to 3 m/s and 0.7 Hz; near the floor; steady
# yaw. A circle of 1 m at 1.2 to 1.8 m/s; near the ceiling; climbs and descents up to 1.5 m/s; waves
# up to 4 m/s. Small waves of 1.2 to 2.2 Hz, for angular acceleration; across the jet of a fan at
# x = -2.3 m.
TRAJECTORIES: dict[str, _Draw] = {
    "hover": lambda rng, t, ceiling: np.tile([0.0, 0.0, 1.2, 0.3], (len(t), 1)),
    "gentle": _path_of_waves(
        (0.0, 0.0, 1.2, 0.0),
        ((0.4, 0.05, 0.15), (0.4, 0.05, 0.15), (0.12, 0.05, 0.15), (0.4, 0.03, 0.1)),
    ),
    "excite": _path_of_waves(
        (0.0, 0.0, 1.4, 0.0),
        ((0.7, 0.1, 0.5), (0.7, 0.1, 0.5), (0.18, 0.15, 0.7), (0.8, 0.05, 0.4)),
    ),
    "ground": _ground,
    "yaw": _yaw,
    "circle": _circle,
    "ceiling": _ceiling,
    "vertical": _path_of_waves(
        (0.0, 0.0, 1.45, 0.0),
        ((0.2, 0.05, 0.2), (0.2, 0.05, 0.2), (0.3, 0.2, 0.6), (0.5, 0.05, 0.2)),
    ),
    "fast": _path_of_waves(
        (0.0, 0.0, 1.5, 0.0),
        ((1.3, 0.08, 0.25), (1.3, 0.08, 0.25), (0.25, 0.1, 0.5), (0.6, 0.05, 0.2)),
    ),
    "shake": _path_of_waves(
        (0.0, 0.0, 1.3, 0.0),
        ((0.03, 1.2, 2.2), (0.03, 1.2, 2.2), (0.1, 0.2, 0.7), (0.4, 0.1, 0.6)),
    ),
    "jet": _path_of_waves(
        (0.0, 0.0, 1.2, math.pi),
        ((0.25, 0.03, 0.1), (0.7, 0.05, 0.2), (0.12, 0.05, 0.2), (0.3, 0.05, 0.2)),
    ),
    "hovers": _hovers((0.0,)),
    "grid": _hovers((-0.5, 0.0, 0.5)),
    "sweep": _sweep,
}


def draw_trajectory(
    name: str, rng: np.random.Generator, t: Array, ceiling: float = math.inf
) -> Array:
    """Return the set points (n, 11) of a trajectory at times ``t`` (n,) s, faded in from the first
    point.

    ``ceiling`` is a height in m; trajectories take 2.6 m for none.

    Raises:
        InputError: no trajectory has this name.
    """
    if name not in TRAJECTORIES:
        raise unknown_name("trajectory", name, TRAJECTORIES)
    path = TRAJECTORIES[name](rng, t, ceiling if math.isfinite(ceiling) else _CEILING)
    fade = np.clip(t / _RAMP, 0.0, 1.0)[:, None]
    path = path[:1] + (path - path[:1]) * fade * fade * (3.0 - 2.0 * fade)
    return setpoints_along(path, t)


def setpoints_along(path: Array, t: Array) -> Array:
    """Return the set points (n, 11) of a path (n, 4) in m and rad of yaw at times (n,) s."""
    speed = np.gradient(path, t, axis=0)
    acceleration = np.gradient(speed[:, :3], t, axis=0)
    return np.hstack([path[:, :3], speed[:, :3], acceleration, path[:, 3:], speed[:, 3:]])


def background(vehicle: Vehicle, strength: float = 1.0) -> PlantSettings:
    """Return weak turbulence in proportion to the vehicle, and times ``strength``."""
    force = strength * vehicle.weight / 4.5126
    return replace(
        BACKGROUND,
        disturbance_force=BACKGROUND.disturbance_force * force,
        disturbance_torque=BACKGROUND.disturbance_torque * force * vehicle.arm_l / 0.127,
    )


def record_flight(
    vehicle: Vehicle,
    effects: tuple[EffectSetting, ...] = (),
    trajectory: str = "excite",
    seconds: float = 60.0,
    seed: int = 0,
    settings: PlantSettings | None = None,
    push: Callable[[ClosedLoop], Array | None] | None = None,
    report: Callable[[float], None] = lambda share: None,
    imu: bool = False,
    fan: Fan | None = None,
    distance: float = 2.3,
) -> dict[str, Array]:
    """Fly a vehicle with undeclared effects; return the columns of a flight log.

    Args:
        vehicle: as declared to its own flight loop.
        effects: undeclared ones.
        trajectory: one of ``TRAJECTORIES``.
        seconds: length of the log.
        seed: for everything random.
        settings: the plant's; default: weak background turbulence in proportion to the vehicle.
        push: returns before each tick the wrench (6,) of the tick: force in N and torque in Nm
            about the centre of mass, world frame; None leaves the last one on. Default: no push.
        report: called now and then with the share done.
        imu: whether to add the true ``gyro`` (n, 3) rad/s and ``accelerometer`` (n, 3) m/s2, body
            axes, without noise or bias: the angular velocity at the instant of the pose, and the
            specific force of the geometric centre, averaged over one tick on either side.
        fan: at the origin, blowing along x with gusts; None: none.
        distance: m, of the trajectory's origin from the fan.

    Returns:
        ``t`` (n,) s, ``position`` (n, 3) m, ``quaternion`` (n, 4), ``rotor_speeds`` (n, 4) rad/s at
        the instant of the sample, and ``voltage`` (n,) V. ``force`` (n, 3) N and ``torque`` (n, 3)
        Nm are the true external force and torque, world frame, about the centre of mass, averaged
        since the sample before.

    Raises:
        InputError: an unknown trajectory, or a length out of range.
    """
    if not TICK * 20 <= seconds <= 7200:
        raise InputError(
            f"record: --seconds must lie between {TICK * 20:g} and 7200, got {seconds:g}"
        )
    rng = np.random.default_rng(seed)
    count = round(seconds / TICK) + 1
    t = TICK * np.arange(count, dtype=np.float64)
    setpoints = draw_trajectory(trajectory, rng, t, vehicle.ceiling_z)
    if fan is not None:
        setpoints[:, 0] += distance
    true = replace(vehicle, effects=(*vehicle.effects, *effects))
    loop = ClosedLoop(vehicle, true, fan=fan, settings=settings or background(vehicle))
    loop.reset(rng, setpoints[0, :3], float(setpoints[0, 9]))
    samples, external, voltage = np.empty((count, 11)), np.zeros((count, 6)), np.empty(count)
    motion = np.empty((count, 10))  # true attitude, velocity and angular velocity
    for k in range(count):
        if k % _REPORTED == 0:
            report(k / count)
        loop.setpoint[:] = setpoints[k]
        wrench = None if push is None else push(loop)
        if wrench is not None:
            loop.applied[:] = wrench
        # the rotors over the interval before, then the pose of this tick's sample
        samples[k, :4], voltage[k], external[k] = loop.unrounded, loop.battery, loop.external
        motion[k, :4], motion[k, 4:] = loop.quaternion, loop.motion[1][:6]
        loop.run(rng.standard_normal((1, NOISE)))
        samples[k, 4:] = loop.sample[4:]
        if not loop.healthy() or loop.position[2] < -0.5:
            raise InputError(
                f"record: {vehicle.name} crashed after {loop.time:.1f} s: the effects are too "
                f"large for its "
                "flight loop"
            )
    # A rotor speed is logged at the instant of the pose, between the ticks before and after. The
    # mean is not even: with semi-implicit steps of half a tick the pose is a quarter of a tick
    # ahead of the clock. Rates are rounded once: a mean of two rounded rates would round to the
    # later one.
    samples[:-1, :4] = 0.25 * samples[:-1, :4] + 0.75 * samples[1:, :4]
    if vehicle.omega_lsb > 0:
        samples[:, :4] = vehicle.omega_lsb * np.round(samples[:, :4] / vehicle.omega_lsb)
    columns = {
        "t": t,
        "position": samples[:, 4:7],
        "quaternion": samples[:, 7:11],
        "rotor_speeds": samples[:, :4],
        "force": external[:, :3],
        "torque": external[:, 3:],
    }
    if vehicle.voltage_ref > 0:
        columns["voltage"] = voltage
    if imu:
        columns["gyro"], columns["accelerometer"] = _inertial(motion, vehicle.gravity)
    return columns


def _inertial(motion: Array, gravity: float) -> tuple[Array, Array]:
    """Return the angular velocity (n, 3) and the specific force (n, 3), body, of attitude (n, 4),
    velocity and angular velocity (n, 6) before each tick.

    The pose is a quarter of a tick ahead of the velocities, as the rotor speeds are brought to it.
    """
    rate = motion[:, 7:].copy()
    rate[:-1] = 0.75 * motion[:-1, 7:] + 0.25 * motion[1:, 7:]
    between = np.diff(motion[:, 4:7], axis=0) / TICK  # over the tick that begins at a sample
    fallen = np.vstack([between[:1], between])
    fallen[:-1] = 0.25 * fallen[:-1] + 0.75 * fallen[1:]
    fallen[:, 2] += gravity
    attitude = Rotation.from_quat(motion[:, :4], scalar_first=True)
    return rate, attitude.inv().apply(fallen)
