"""A tick of several closed loops side by side: the plant's, the flight loop's and the filter's own
functions, compiled for lanes (``runtime.vector_lanes``).

MuJoCo is not called here. What it does with a free rigid body, one semi-implicit Euler step, is
``fly_freely``, whose equations of motion are those of the filter's prediction.
"""

import numpy as np

from ...controllers.flight import FLIGHT, FlightGains, fly, move_setpoint
from ...dynamics.motion import BODY, Array, accelerations, rotor_wrench
from ...dynamics.rotation import normalise, quaternion_to_matrix, turn_body
from ...estimator.ukf_lanes import in_hand
from ...runtime.addresses import call_at
from ...runtime.compiled import Record, compiled
from ...runtime.vector_lanes import LaneRecord
from ..fan import FAN
from ..plant import (
    NOISE,
    PLANT,
    SUBSTEPS,
    TICK,
    add_up,
    blow,
    disturb,
    follow,
    log_speeds,
    lose_pose,
    measure,
)

# a block of loops, as one of them would have it
_LOOP = np.dtype(
    [
        ("plant", PLANT),
        ("flight", FLIGHT),
        ("fan", FAN),
        ("qpos", "f8", (7,)),  # as MuJoCo's
        ("qvel", "f8", (6,)),
        ("xfrc", "f8", (6,)),
        ("acceleration", "f8", (6,)),
        ("noise", "f8", (NOISE,)),  # unit normals of the tick in hand
        ("none", "f8", (6,)),
    ]
)
# the true body is each vehicle's own, the declared one that of all
_BODY = LaneRecord(BODY, ("mass", "inertia", "inverse_inertia"), ("gravity", "com", "k", "mixing"))
_PLANT = LaneRecord(
    PLANT,
    (
        "omega_max",
        "rotor_wrench",
        "speeds",
        "z",
        "disturbance",
        "external",
        "jet",
        "rotation",
        "q",
        "rho",
        "scratch",
    ),
    (
        "motor_keep",
        "omega_lsb",
        "sigma_position",
        "sigma_attitude",
        "disturbance_force",
        "disturbance_torque",
        "disturbance_keep",
        "dropout",
        "effect_wrench",
        "applied",
    ),
    {"body": _BODY},
)
_FLIGHT = LaneRecord(
    FLIGHT,
    ("setpoint", "sum", "yaw_sum", "rotation", "command"),
    ("body", "unmixing", "omega_max", "foreseen", *FlightGains.__dataclass_fields__),
)
_FAN = LaneRecord(
    FAN,
    ("speed", "rotor_drag", "hull_area", "gusts", "y"),
    ("height", "turbulence", "keep", "mixing", "stations", "blown", "air"),
)
LOOPS = LaneRecord(
    _LOOP,
    ("qpos", "qvel", "xfrc", "acceleration", "noise"),
    ("none",),
    {"plant": _PLANT, "flight": _FLIGHT, "fan": _FAN},
)
_loop_at = LOOPS.at


@compiled
def fly_freely(loop: Record, dt: float) -> None:
    """Carry free rigid bodies ``dt`` s ahead as MuJoCo's integrator "Euler" does: velocities first,
    by explicit Euler, and with these new ones the pose.
    """
    qpos, qvel, q, R = loop.qpos, loop.qvel, loop.plant.q, loop.plant.rotation
    quaternion_to_matrix(qpos[3:7], R)
    accelerations(
        loop.plant.body,
        R,
        qvel[3:6],
        loop.none,
        loop.xfrc[3:6],
        loop.xfrc[0:3],
        loop.none,
        loop.acceleration,
    )
    for i in range(6):
        qvel[i] += dt * loop.acceleration[i]
    for i in range(3):
        qpos[i] += dt * qvel[i]
    turn_body(qpos[3:7], qvel[3], qvel[4], qvel[5], dt, q)
    normalise(q)
    for i in range(4):
        qpos[3 + i] = q[i]


@compiled
def tick_lanes(address: int, work: int, step: int, axial: Array, radial: Array) -> None:
    """Do what ``closed_loop.tick`` does, and then MuJoCo, with the loops whose record lies at
    ``address``.

    Their filters are in hand in the record at ``work``, and ``step`` is the address of those's
    step.
    """
    loop, f = _loop_at(address), in_hand(work)
    plant, flight, fan, qpos, qvel = loop.plant, loop.flight, loop.fan, loop.qpos, loop.qvel
    measure(plant, qpos, loop.noise)
    lose_pose(plant, loop.noise)
    for i in range(11):
        f.z[i] = plant.z[i]
    call_at(step, work)
    move_setpoint(flight, f.x, TICK)
    fly(flight, f.x, TICK)
    follow(plant, flight.command)
    log_speeds(plant, plant.speeds)
    rotor_wrench(plant.body, plant.speeds, plant.rotor_wrench)
    quaternion_to_matrix(qpos[3:7], plant.rotation)
    blow(plant, fan, axial, radial, qpos, qvel, loop.noise)
    disturb(plant, loop.noise)
    add_up(plant, loop.xfrc)
    for _ in range(SUBSTEPS):
        fly_freely(loop, TICK / SUBSTEPS)


__all__ = ["LOOPS", "fly_freely", "tick_lanes"]
