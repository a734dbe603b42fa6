"""The plant: a quadrotor in MuJoCo with real motors, real sensing and effects that nobody declared.

One tick is one sample of the motion capture (5 ms). The motors follow their commands. Rotors,
effects, jet and unmodelled disturbance make a wrench for the tick, and MuJoCo integrates the rigid
body in two steps.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import resources
from typing import Any

import mujoco
import numpy as np

from .. import _core
from ..controllers.briefing import standard_vehicle
from ..dynamics.model import (
    MODEL_FIELDS,
    load_model,
    reset_model,
)
from ..dynamics.vehicle import Vehicle
from ..runtime.arrays import Array
from ..runtime.errors import InputError
from .fan import STATIONS

TICK = 0.005  # s
SUBSTEPS = 2
# unit normals that one tick uses: pose, disturbance, gusts, dropout
NOISE = 6 + 6 + 3 * STATIONS + 1
MAX_DELAY = 0.1  # s, of what is kept for later
_KEPT = round(MAX_DELAY / TICK) + 1


@dataclass(frozen=True)
class PlantSettings:
    """Properties of the plant beyond its vehicle file."""

    motor_lag: float = 0.04  # s, of a first-order motor whose true rotor speed is logged
    # N, standard deviation of the unmodelled part of the actuation, each axis
    disturbance_force: float = 0.03
    disturbance_torque: float = 0.01  # Nm
    disturbance_time: float = 0.3  # s, its correlation time
    # s, delay of a command or measurement: at most ``MAX_DELAY``, whole ticks
    actuator_delay: float = 0.0  # rotor commands, before the motors' lag
    pose_delay: float = 0.0  # the pose, not the logged rotor speeds
    imu_delay: float = 0.0  # the accelerometer, if any
    dropout: float = 0.0  # share of the poses that are lost
    dropout_burst: float = 0.0  # s, mean length of a run of lost poses; 0: each alone
    battery_life: float = 480.0  # s, over which the voltage falls by a tenth
    sensor_noise: bool = True

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle) -> "PlantSettings":
        """Return the settings with the AR.Drone's disturbance scaled to a vehicle: force by the
        weight, torque by the inertia, for the same accelerations.
        """
        standard = standard_vehicle()
        torque = 0.01 * (standard.weight / 4.56) * standard.arm_l / 0.1262
        inertia = vehicle.inertia[0, 0] / standard.inertia[0, 0]
        return cls(
            disturbance_force=0.03 * (vehicle.weight / 4.56), disturbance_torque=torque * inertia
        )


PLANT = np.dtype(
    [
        *MODEL_FIELDS,
        ("seen", "i8"),  # parts of the last pose that were measured
        # ``battery``: V now; 0: not modelled
        *[
            (name, "f8")
            for name in (
                "voltage_ref",
                "battery_life",
                "battery",
                "motor_keep",
                "omega_lsb",
                "sigma_position",
                "sigma_attitude",
                "disturbance_force",
                "disturbance_torque",
                "disturbance_keep",
            )
        ],
        ("applied", "f8", (6,)),  # a user's part of ``external``, until changed
        ("omega_max", "f8"),
        # a unit normal below loses the pose: after a pose, and after a lost one
        ("dropout", "f8"),
        ("dropout_kept", "f8"),
        ("lost", "f8", (1,)),  # 1: the last pose was lost
        ("actuator_late", "f8"),  # ticks
        ("pose_late", "f8"),
        ("imu_late", "f8"),
        ("speeds", "f8", (4,)),  # motors, rad/s
        # the sample: logged rotor speeds of the last tick, position, quaternion
        ("z", "f8", (11,)),
        ("disturbance", "f8", (6,)),
        ("external", "f8", (6,)),  # true external force and torque about the centre of mass, world
        ("jet", "f8", (6,)),  # the jet's part of it
        ("rotation", "f8", (3, 3)),
        # the last ticks, the newest first: rad/s; m and quaternion; m/s2, body
        ("past_commands", "f8", (_KEPT, 4)),
        ("past_poses", "f8", (_KEPT, 7)),
        ("past_felt", "f8", (_KEPT, 3)),
    ]
)


assert PLANT.itemsize == _core.PLANT_SIZE, "the core was built for another layout"


def plant_record(vehicle: Vehicle, settings: PlantSettings) -> tuple[np.ndarray, Vehicle]:
    """Return the plant's memory (1,) for the true vehicle, and that vehicle with its body effects
    applied.
    """
    from scipy.special import ndtri

    record = np.zeros(1, dtype=PLANT)
    p = record[0]
    # the effect library's ground is the plant's floor
    vehicle = vehicle if math.isfinite(vehicle.floor_z) else replace(vehicle, floor_z=0.0)
    amended = load_model(p, vehicle)
    # with an undeclared lag the log holds commands: the motor's own lag then is the effect's
    lag = 0.0 if any(e.name == "motor_lag" for e in vehicle.effects) else settings.motor_lag
    p["motor_keep"] = math.exp(-TICK / lag) if lag > 0 else 0.0
    p["omega_max"] = (
        vehicle.omega_max if math.isfinite(vehicle.omega_max) else 2.0 * vehicle.hover_rate
    )
    p["omega_lsb"] = vehicle.omega_lsb
    if settings.sensor_noise:
        p["sigma_position"] = vehicle.mocap.sigma_pos_m
        p["sigma_attitude"] = vehicle.mocap.sigma_att_rad
    for name in ("disturbance_force", "disturbance_torque", "battery_life"):
        p[name] = getattr(settings, name)
    p["disturbance_keep"] = math.exp(-TICK / settings.disturbance_time)
    for name in ("actuator", "pose", "imu"):
        delay = getattr(settings, f"{name}_delay")
        if not 0.0 <= delay <= MAX_DELAY:
            raise InputError(
                f"PlantSettings: {name}_delay must be 0 to {MAX_DELAY} s, got {delay!r}"
            )
        p[f"{name}_late"] = round(delay / TICK)
    share, leaves, burst = settings.dropout, 1.0 - settings.dropout, settings.dropout_burst
    if not 0.0 <= share <= 1.0:
        raise InputError(f"PlantSettings: dropout must be 0 to 1, got {share!r}")
    if burst != 0.0 and 0.0 < share < 1.0:
        shortest = TICK * max(1.0, share / leaves)
        if not burst >= shortest:
            raise InputError(
                f"PlantSettings: dropout_burst must be 0, or at least {shortest:.4g} s where a "
                f"share of {share:g} is lost, got {burst!r}"
            )
        # Gilbert, Bell System Technical Journal 39 (1960): a chain of two states
        ends = TICK / burst
        share, leaves = ends * share / leaves, ends
    p["dropout"] = ndtri(share)
    p["dropout_kept"] = ndtri(1.0 - leaves) if burst != 0.0 else p["dropout"]
    p["voltage_ref"] = vehicle.voltage_ref
    return record, amended


def reset_plant(p: np.void, vehicle: Vehicle) -> None:
    """Put the plant's memory at hover; ``vehicle`` is the true one with its body
    effects applied.
    """
    reset_model(p)
    for name in ("disturbance", "external", "jet", "applied", "lost"):
        p[name] = 0.0
    p["past_commands"], p["past_felt"] = vehicle.hover_rate, [0.0, 0.0, vehicle.gravity]
    p["speeds"] = vehicle.hover_rate
    p["battery"] = 1.05 * vehicle.voltage_ref
    p["z"][:4] = p["speeds"]


def is_a_body(inertia: Array) -> bool:
    """Return whether any body has an inertia (3, 3): no principal moment exceeds the sum of the
    others.
    """
    moments = np.linalg.eigvalsh(inertia)
    return bool(moments[0] + moments[1] >= moments[2])


def is_same_body(one: Vehicle, other: Vehicle) -> bool:
    """Return whether two vehicles are the same to MuJoCo."""
    mine, its = (
        np.hstack([v.mass, v.gravity, v.arm_l, v.com, v.inertia.ravel()]) for v in (one, other)
    )
    return np.array_equal(mine, its)


def load_world(
    vehicle: Vehicle, drawn: bool = True, add: Callable[[Any], None] | None = None
) -> tuple["mujoco.MjModel", "mujoco.MjData"]:
    """Return MuJoCo's model and data of the world with a vehicle after its body effects.

    Args:
        vehicle: with its body effects applied.
        drawn: whether the world has its parts for the eye alone. Without them the vehicle moves
            alike, bit for bit, a fifth faster.
        add: adds constrained bodies to the world before it is compiled; default: none.

    Raises:
        InputError: no body has the vehicle's inertia.
    """
    xml = resources.files(__package__).joinpath("quadrotor.xml").read_text(encoding="utf-8")
    spec = mujoco.MjSpec.from_string(xml)
    moments, axes = np.linalg.eigh(vehicle.inertia)
    if not is_a_body(vehicle.inertia):
        raise InputError(
            f"{vehicle.name}: no body has the principal moments of inertia {moments[0]:.4g}, "
            f"{moments[1]:.4g} and {moments[2]:.4g} kg m2: the largest exceeds the sum of the "
            f"others"
        )
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
    # before compilation: the compiler takes short cuts for a centre of mass in the body's origin
    body = spec.body("vehicle")
    body.mass, body.inertia, body.ipos, body.iquat = vehicle.mass, moments, vehicle.com, quaternion
    if add is not None:
        add(spec)
    spec.compiler.discardvisual = not drawn
    if not drawn:
        for part in (*spec.cameras, *spec.lights, spec.body("fan")):
            spec.delete(part)
    model = spec.compile()
    if add is None:  # no other constraint or spring
        flags = mujoco.mjtDisableBit
        for flag in (flags.mjDSBL_CONSTRAINT, flags.mjDSBL_SPRING, flags.mjDSBL_DAMPER):
            model.opt.disableflags |= int(flag)
    model.opt.gravity[2] = -vehicle.gravity
    model.opt.timestep = TICK / SUBSTEPS
    # the drawing follows the vehicle's size
    parts = model.geom_bodyid == model.body("vehicle").id
    for lengths in (model.geom_pos, model.geom_size):
        lengths[parts] *= vehicle.arm_l / 0.1262
    return model, mujoco.MjData(model)
