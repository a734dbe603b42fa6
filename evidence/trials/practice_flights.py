"""Flights for a diagnosis to practise on: what was added to the vehicle is known, and nothing of it
is declared.

Five kinds: nothing added, one effect, two effects, a hover (in which many an effect cannot be told
from another), and a disturbance outside the library. All are flown in MuJoCo and kept in memory.
"""

import zlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from windwrench.dynamics.effects import get, names
from windwrench.dynamics.vehicle import EffectSetting, Mocap, Vehicle
from windwrench.envs.closed_loop import ClosedLoop
from windwrench.envs.plant import TICK, is_a_body
from windwrench.envs.recording import background, draw_trajectory, record_flight
from windwrench.evidence.trials.outsiders import HELD_BACK, OUTSIDERS, wrench_input
from windwrench.identification.diagnosis.coefficients import typical_size
from windwrench.identification.diagnosis.column import Column
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.runtime.errors import InputError, unknown_name

Array = NDArray[np.float64]

SIZES = {"small": 1.0 / 3.0, "typical": 1.0, "large": 1.6}  # factor on the library's typical sizes
KINDS = ("nothing", "effect", "pair", "hover", "outsider")
_CEILING = 2.6  # m, of the room where the vehicle does not say

_FREE = ("excite", "vertical", "fast", "yaw", "circle", "gentle")
# Flights in which an effect shows; elsewhere any of _FREE. In the first the coefficient that is
# known worst is known about as well as in any: on the AR.Drone with noise and turbulence of once
# what is declared rate_damping, for one, to 0.7 %, in the yawing flight to 7 %; body_drag to 13 %
# on the fast one, to 18 % on excite; com_offset to 1.5 % on shake, to 4 % on excite, marker_offset
# to 0.8 and to 2.5 %.
_SHOWN: Mapping[str, tuple[str, ...]] = {
    "com_offset": ("shake", *_FREE),
    "ground_effect": ("ground",),
    "ceiling_effect": ("ceiling",),
    "fan_jet": ("jet",),
    "rotor_drag": ("excite", "fast", "circle"),
    "body_drag": ("fast", "excite", "circle"),
    "wind": ("excite", "fast"),
    "flapping_moment": ("excite", "fast"),
    "translational_lift": ("fast", "excite"),
    "inflow_thrust": ("excite", "vertical"),
    "inflow_drag": ("excite", "fast"),
    "rotor_interaction": ("excite", "fast"),
    "rate_damping": ("excite", "yaw"),
    "attitude_gain": ("excite", "fast"),
    "world_tilt": ("yaw", "excite"),
    "thrust_axis_tilt": ("yaw", "excite"),
    "inertia": ("excite", "fast"),
    "motor_lag": ("excite", "vertical"),
    "latency": ("excite", "vertical"),
    "clock_offset": ("excite", "fast"),
    "rotor_inertia": ("excite", "fast"),
    "marker_offset": ("shake", "excite", "yaw"),
    "thrust_curvature": ("excite", "vertical"),
    "thrust_scale": ("vertical", "excite"),
    "mass": ("vertical", "excite", "gentle"),
    "cubic_drag": ("excite", "fast"),
    "patchy_drag": ("excite", "fast"),
    "magnus_force": ("excite", "yaw"),
    "vortex_ring": ("vertical",),
    "thrust_saturation": ("vertical", "excite"),
    "thermal_column": ("gentle", "excite", "jet"),
    "wall_attraction": ("gentle", "circle", "jet"),
    "flywheel": ("excite", "fast"),
    "sloshing": ("excite", "fast"),
    "tether": ("excite", "gentle"),
    **dict.fromkeys(HELD_BACK, ("excite", "fast")),
}
_TYPICAL_MASSES = (0.465, 0.027)  # kg, of the vehicles that the library's typical sizes are of
# coefficients that say where and of what kind a thing is, not how strong
_NOT_SIZES: Mapping[str, tuple[str, ...]] = {
    "fan_jet": ("x", "y", "z", "heading", "kd", "area"),
    "slung_payload": ("l", "damping"),
    "wind": ("cd",),
}
# s: with the motors' own lag, the flight loop falls over a delay of 42 ms
_MOST: Mapping[str, float] = {"latency": 0.038, "clock_offset": 0.038}
# effects whose coefficients may have either sign
_SIGNED = (
    "clock_offset",
    "com_offset",
    "constant_force",
    "constant_torque",
    "inertia",
    "marker_offset",
    "mass",
    "rotor_interaction",
    "thrust_axis_tilt",
    "thrust_curvature",
    "thrust_scale",
    "wind",
    "world_tilt",
)
# what a hover shows and cannot tell apart
_HOVERING = (
    "mass",
    "thrust_scale",
    "constant_force",
    "com_offset",
    "constant_torque",
    "rotor_efficiency",
    "world_tilt",
    "thrust_axis_tilt",
)

# effects of flight faster than these: drawn where they are asked for by name alone
_FASTER = ("inflow_drag", "rotor_interaction")


class Practice(NamedTuple):
    """One practice flight: the log that a diagnosis gets of it, and what was done."""

    log: FlightLog
    vehicle: Vehicle  # as declared
    effects: tuple[EffectSetting, ...]  # that the vehicle has and does not declare
    outsider: str | None  # disturbance outside the library
    trajectory: str


def fly_practice(
    vehicle: Vehicle,
    effects: tuple[EffectSetting, ...] = (),
    trajectory: str = "excite",
    seconds: float = 60.0,
    seed: int = 0,
    outsider: str | None = None,
    turbulence: float = 1.0,
    sensor: float = 1.0,
    outsider_size: float = 1.0,
    imu: bool = False,
    gust_time: float | None = None,
    seen: float = 1.0,
    outsider_rng: np.random.Generator | None = None,
    push: Callable[[ClosedLoop], Array] | None = None,
) -> FlightLog:
    """Fly a vehicle with effects that it does not declare and with a disturbance; return the log,
    with the true wrench.

    Args:
        vehicle: as declared.
        effects: what it has besides.
        trajectory: one of ``envs.recording.TRAJECTORIES``.
        seconds: length of the log.
        seed: of everything random; the same arguments give the same log.
        outsider: one of ``OUTSIDERS`` or of ``HELD_BACK``, or none.
        turbulence: factor on the background turbulence; 0: still air.
        sensor: factor on the declared noise of the pose.
        outsider_size: factor on the disturbance.
        imu: whether the log has gyro and accelerometer, true to the last digit.
        gust_time: s, correlation time of the turbulence; default: the plant's.
        seen: share of the log's noise that the flight loop's own pose has. A loop that reads a gyro
            sees more than a log of poses holds: with a small share it answers a gust before the
            log shows it.
        outsider_rng: of what the disturbance draws; default: one of ``seed``.
        push: wrench (6,) of each tick in place of an outsider's, as of ``record_flight``.

    Raises:
        InputError: an unknown name, a number out of range, or a crash.
    """
    if not 0.0 < seen <= 1.0:
        raise InputError(f"fly_practice: seen must be a number above 0 and at most 1, got {seen}")
    for what, value in (("turbulence", turbulence), ("sensor", sensor)):
        if not 0.0 <= value < np.inf:
            raise InputError(
                f"fly_practice: {what} must be a finite number of at least 0, got {value}"
            )
    noise, flown = vehicle.mocap, vehicle
    if sensor > 0.0:  # the filter that flies cannot believe in a perfect pose
        pose = sensor * seen * noise.sigma_pos_m, sensor * seen * noise.sigma_att_rad
        flown = replace(vehicle, mocap=Mocap(noise.rate_hz, *pose))
    settings = replace(background(vehicle, turbulence), sensor_noise=sensor > 0.0)
    if gust_time is not None:
        settings = replace(settings, disturbance_time=gust_time)
    disturbance = push
    if outsider is not None:
        t = TICK * np.arange(max(round(seconds / TICK), 1) + 1, dtype=np.float64)
        path = draw_trajectory(trajectory, np.random.default_rng(seed), t, vehicle.ceiling_z)[:, :3]
        known = {**OUTSIDERS, **HELD_BACK}
        if outsider not in known:
            raise unknown_name("disturbance", outsider, known)
        rng = outsider_rng or np.random.default_rng((seed, 1))
        disturbance = wrench_input(known[outsider](vehicle, rng, path), outsider_size)
    c = record_flight(flown, effects, trajectory, seconds, seed, settings, disturbance, imu=imu)
    added = "+".join([*(e.name for e in effects), *([outsider] if outsider else [])]) or "nothing"
    position, quaternion = c["position"], c["quaternion"]
    if seen < 1.0:  # what the log's pose has more
        rng = np.random.default_rng((seed, 2))
        more = sensor * np.sqrt(1.0 - seen**2) * rng.standard_normal((len(position), 6))
        position = position + noise.sigma_pos_m * more[:, :3]
        turned = Rotation.from_rotvec(noise.sigma_att_rad * more[:, 3:])
        true = Rotation.from_quat(quaternion, scalar_first=True)
        quaternion = (turned * true).as_quat(canonical=True, scalar_first=True)
    return FlightLog(
        c["t"],
        position,
        quaternion,
        c["rotor_speeds"],
        c.get("voltage"),
        c["force"],
        c["torque"],
        accelerometer=c.get("accelerometer"),
        gyro=c.get("gyro"),
        name=f"{added}_{trajectory}_{seed}",
        source="flown in MuJoCo by fly_practice",
    )


def of_mass(vehicle: Vehicle, mass: float) -> Vehicle:
    """Return a vehicle of another mass (kg) and the same density, whose rotor tips are as fast.

    Lengths go with the third root of mass, inertia with its power of 5/3, rotor speeds with the
    inverse of length.
    """
    length = (mass / vehicle.mass) ** (1.0 / 3.0)
    return replace(
        vehicle,
        mass=mass,
        inertia=vehicle.inertia * length**5,
        arm_l=vehicle.arm_l * length,
        rotor_positions=vehicle.positions * length,
        rotor_radius=vehicle.rotor_radius * length,
        # a weight of length^3 at a rotor speed of 1/length; torque has an arm of a length more
        k=vehicle.k * length**5,
        p=vehicle.p * length**6,
        omega_lsb=vehicle.omega_lsb / length,
        omega_max=vehicle.omega_max / length,
    )


def shown_in(name: str) -> tuple[str, ...]:
    """Return the trajectories in which an effect, or a disturbance outside the library, shows; the
    first shows it best.
    """
    return _SHOWN.get(name, _FREE)


def draw_effect(name: str, vehicle: Vehicle, size: str, rng: np.random.Generator) -> EffectSetting:
    """Return an effect near the library's typical size for the vehicle, with signs and a factor of
    0.8 to 1.25 at random.

    An inertia that no body has is drawn anew.

    Raises:
        InputError: no such effect or size.
    """
    if size not in SIZES:
        raise unknown_name("size", size, SIZES)
    # the library's own vehicles have its typical sizes, others what lies between
    column = 1 if vehicle.mass < 0.1 else 0
    like = replace(vehicle, mass=_TYPICAL_MASSES[column])
    coefficients = {
        c.name: c.typical[column]
        * typical_size(Column(name, c.name), vehicle)
        / typical_size(Column(name, c.name), like)
        for c in get(name).coefficients
    }
    if name == "rotor_efficiency":
        # one weak rotor, any of the four
        weak = rng.permutation(4)
        coefficients = {f"e{i + 1}": coefficients[f"e{weak[i] + 1}"] for i in range(4)}
    factor = SIZES[size] * float(np.exp(rng.uniform(np.log(0.8), np.log(1.25))))
    for c in get(name).coefficients:
        if c.name not in _NOT_SIZES.get(name, ()):
            sign = float(rng.choice([-1.0, 1.0])) if name in _SIGNED else 1.0
            most = _MOST.get(name, np.inf)
            coefficients[c.name] = min(
                max(sign * factor * coefficients[c.name], c.minimum, -most), c.maximum, most
            )
    amend = get(name).amend
    if amend and is_a_body(vehicle.inertia) and not is_a_body(amend(vehicle, coefficients).inertia):
        return draw_effect(name, vehicle, size, rng)
    return EffectSetting(name, coefficients)


def practise(
    vehicle: Vehicle,
    kind: str,
    added: tuple[str, ...] = (),
    size: str = "typical",
    trajectory: str | None = None,
    seed: int = 0,
    seconds: float = 60.0,
    turbulence: float | None = None,
    **more: Any,
) -> Practice:
    """Fly one practice flight.

    Args:
        vehicle: as declared; without a ceiling it gets one at 2.6 m.
        kind: one of ``KINDS``.
        added: names of effects, or one of ``OUTSIDERS`` or ``HELD_BACK``; more is drawn from
            ``seed`` where a kind asks for more.
        size: one of ``SIZES``, of the effects and of the disturbance.
        trajectory: default: one in which what was added shows.
        seed: of everything random.
        seconds: length of the log.
        turbulence: factor on the background; default: 0 or 1 at random.
        more: as of ``fly_practice``.

    Raises:
        InputError: an unknown name, or a crash.
    """
    if kind not in KINDS:
        raise unknown_name("kind", kind, KINDS)
    if size not in SIZES:
        raise unknown_name("size", size, SIZES)
    vehicle = vehicle if np.isfinite(vehicle.ceiling_z) else replace(vehicle, ceiling_z=_CEILING)
    # equal seeds of different flights must not draw equal signs and sizes
    held_back = bool(added) and added[0] in HELD_BACK
    words = (*added, size) if held_back else (kind, *added, size)
    rng = np.random.default_rng((seed, zlib.crc32("+".join(words).encode())))
    pools = {"outsider": tuple(OUTSIDERS), "hover": _HOVERING}
    pool = pools.get(kind) or _in_the_open(names())
    while len(added) < {"nothing": 0, "pair": 2}.get(kind, 1):
        added = (*added, str(rng.choice([name for name in pool if name not in added])))
    outsider = added[0] if kind == "outsider" else None
    effects = () if outsider else tuple(draw_effect(name, vehicle, size, rng) for name in added)
    if trajectory is None:
        shown = [shown_in(name) for name in added] or [_FREE]
        both = [name for name in shown[0] if all(name in others for others in shown)]
        trajectory = "hover" if kind == "hover" else str(rng.choice(both or ["excite"]))
    turbulence = float(rng.integers(2)) if turbulence is None else turbulence
    log = fly_practice(
        vehicle,
        effects,
        trajectory,
        seconds,
        seed,
        outsider,
        turbulence,
        sensor=float(rng.choice([0.5, 1.0, 2.0])),
        outsider_size=SIZES[size],
        outsider_rng=rng if held_back else None,
        **more,
    )
    return Practice(log, vehicle, effects, outsider, trajectory)


def _in_the_open(effects: tuple[str, ...]) -> tuple[str, ...]:
    """Return the effects that show away from floor, ceiling and fan, at these flights' speeds."""
    return tuple(
        name for name in effects if set(shown_in(name)) & set(_FREE) and name not in _FASTER
    )
