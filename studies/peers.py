"""Flights in other people's simulators: what does a diagnosis find that was not put there?

PyBullet (E. Coumans and Y. Bai) is the engine of several drone simulators, RotorPy (S. Folk,
J. Paulos and V. Kumar, 2023) one of its own. A vehicle without any aerodynamics flies there under
this kit's flight loop, and its pose with the noise of motion capture and its rotor speeds are
diagnosed. ``python -m studies.peers`` needs ``pip install pybullet rotorpy`` and some five minutes.
"""

from collections.abc import Callable, Mapping
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from windwrench import __version__
from windwrench.controllers.flight import flight_record, fly
from windwrench.dynamics import load_vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit
from windwrench.studies.kept_results import DOCS, kept
from windwrench.studies.runner import start

Array = NDArray[np.float64]
State = tuple[Array, Array, Array, Array]  # position, quaternion, velocity, body rate
Step = Callable[[Array], tuple[State, Array]]  # rotor speeds asked for -> state, rotor speeds

VEHICLE = load_vehicle("hummingbird")
SECONDS, PERIOD, SEEDS = 40.0, 0.01, range(5)
CENTRE = np.array([0.0, 0.0, 4.0])  # m, of the path: far from the ground
RESULTS = "results/peers.json"
# 1/s and 1/m: PyBullet's default slows a free body by this times (1 + |v|) v: bodies let go at 0.5
# to 4 m/s show it
DAMPING = 0.04
_SUBSTEPS = 5  # of PyBullet in a period
_FREQUENCIES = 2.0 * np.pi * np.array([[0.11, 0.13, 0.17], [0.29, 0.23, 0.31]])  # rad/s
_SIZES = np.array([[1.6, 1.4, 0.5], [0.35, 0.4, 0.25]])  # m


def in_pybullet(damping: bool) -> Step:
    """Return a step of a rigid body in PyBullet; ``damping``: with the engine's own defaults."""
    import pybullet
    from pybullet_utils.bullet_client import BulletClient

    world = BulletClient(pybullet.DIRECT)
    world.setGravity(0.0, 0.0, -VEHICLE.gravity)
    world.setTimeStep(PERIOD / _SUBSTEPS)
    body = world.createMultiBody(VEHICLE.mass, -1, -1, CENTRE.tolist())
    world.changeDynamics(body, -1, localInertiaDiagonal=np.diagonal(VEHICLE.inertia).tolist())
    if not damping:
        world.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)

    def step(speeds: Array) -> tuple[State, Array]:
        thrust, *torque = VEHICLE.rotor_wrench(speeds[None])[0].tolist()
        for _ in range(_SUBSTEPS):
            _, q = world.getBasePositionAndOrientation(body)
            turned = Rotation.from_quat(q).apply(torque).tolist()
            world.applyExternalForce(body, -1, [0, 0, thrust], [0, 0, 0], pybullet.LINK_FRAME)
            world.applyExternalTorque(body, -1, turned, pybullet.WORLD_FRAME)
            world.stepSimulation()
        p, q = world.getBasePositionAndOrientation(body)
        v, w = map(np.array, world.getBaseVelocity(body))
        return (np.array(p), np.roll(q, 1), v, Rotation.from_quat(q).inv().apply(w)), speeds

    return step


def in_rotorpy() -> Step:
    """Return a step of RotorPy's quadrotor with rotors of 5 ms and no aerodynamics."""
    from rotorpy.vehicles.multirotor import Multirotor

    arm = VEHICLE.arm_l
    corners = [(arm, arm), (-arm, arm), (-arm, -arm), (arm, -arm)]
    none = dict.fromkeys(("Ixy", "Iyz", "Ixz", "c_Dx", "c_Dy", "c_Dz"), 0.0)
    none |= dict.fromkeys(
        ("k_d", "k_z", "k_h", "k_flap", "motor_noise_std", "rotor_speed_min"), 0.0
    )
    plane = Multirotor(
        {
            **none,
            **dict(zip(("Ixx", "Iyy", "Izz"), np.diagonal(VEHICLE.inertia), strict=True)),
            "mass": VEHICLE.mass,
            "num_rotors": 4,
            "rotor_pos": {f"r{i}": np.array([x, y, 0.0]) for i, (x, y) in enumerate(corners)},
            "rotor_directions": np.array([1, -1, 1, -1]),
            "rI": np.zeros((3, 3)),
            "k_eta": VEHICLE.k[0],
            "k_m": VEHICLE.p[0],
            "tau_m": 0.005,
            "rotor_speed_max": VEHICLE.omega_max,
        },
        control_abstraction="cmd_motor_speeds",
    )
    now = {
        "x": CENTRE,
        "q": np.array([0.0, 0.0, 0.0, 1.0]),
        "rotor_speeds": np.full(4, VEHICLE.hover_rate),
        **{name: np.zeros(3) for name in ("v", "w", "wind")},
    }

    def step(speeds: Array) -> tuple[State, Array]:
        nonlocal now
        before = now["rotor_speeds"]
        now = plane.step(now, {"cmd_motor_speeds": speeds}, PERIOD)
        state = now["x"], np.roll(now["q"], 1), now["v"], now["w"]
        return state, 0.5 * (before + now["rotor_speeds"])

    return step


def flight(step: Step, seed: int) -> FlightLog:
    """Return a flight along sines, with the noise of the vehicle's motion capture."""
    generator = np.random.default_rng(seed)
    phase = generator.uniform(0.0, 2.0 * np.pi, (2, 3))
    loop = flight_record(VEHICLE)[0]
    p, q = CENTRE, np.array([1.0, 0.0, 0.0, 0.0])
    state: State = p, q, np.zeros(3), np.zeros(3)
    rows = []
    for i in range(round(SECONDS / PERIOD)):
        now = i * PERIOD
        begun = min(now / 3.0, 1.0)  # the path grows from the start's place
        angle = _FREQUENCIES * now + phase
        way = np.array(
            [
                (_SIZES * np.sin(angle)).sum(axis=0) + CENTRE,
                (_SIZES * _FREQUENCIES * np.cos(angle)).sum(axis=0),
                (-_SIZES * _FREQUENCIES**2 * np.sin(angle)).sum(axis=0),
            ]
        )
        way[0] = p + begun * (way[0] - p)
        loop["setpoint"][:9] = (way * [[1.0], [begun], [begun]]).ravel()
        loop["setpoint"][9:] = 0.6 * np.sin(0.44 * now), 0.264 * np.cos(0.44 * now)
        fly(loop, np.concatenate(state), PERIOD)
        state, speeds = step(loop["command"].copy())
        rows.append(np.concatenate([[now + PERIOD], state[0], state[1], speeds]))
    t, position, quaternion, speeds = np.split(np.array(rows), [1, 4, 8], axis=1)
    noise = generator.normal(size=(2, len(t), 3))
    seen = Rotation.from_quat(quaternion, scalar_first=True) * Rotation.from_rotvec(
        VEHICLE.mocap.sigma_att_rad * noise[0]
    )
    return FlightLog(
        t[:, 0],
        position + VEHICLE.mocap.sigma_pos_m * noise[1],
        seen.as_quat(scalar_first=True),
        speeds,
        name=f"seed {seed}",
    )


WORLDS: Mapping[str, Callable[[], Step]] = {
    "PyBullet": lambda: in_pybullet(True),
    "PyBullet, damping set to zero": lambda: in_pybullet(False),
    "RotorPy": in_rotorpy,
}


def diagnosed(world: str, seed: int) -> dict[str, Any]:
    """Return what a diagnosis says of one flight."""
    said = diagnose([flight(WORLDS[world](), seed)], VEHICLE)
    named = [
        {
            "name": e.name,
            "sure": not e.tentative,
            "coefficients": dict(e.coefficients),
            "std": dict(e.std),
        }
        for e in said.effects
    ]
    return {
        "world": world,
        "seed": seed,
        "verdict": said.verdict,
        "unknown": said.probabilities.unknown,
        "effects": named,
    }


def shown() -> dict[str, Any]:
    """Return the kept results, the engine's own drag, and what was found of it, each coefficient
    with its standard deviation: linear in N/(m/s), quadratic in N/(m/s)^2.
    """
    result: dict[str, Any] = kept(RESULTS)
    drags = [e for row in result["flights"] for e in row["effects"] if e["name"] == "body_drag"]
    parts = [(e, axis) for e in drags for axis in "xyz"]
    coefficients = {
        kind: sorted((e["coefficients"][kind + axis], e["std"][kind + axis]) for e, axis in parts)
        for kind in "dc"
    }
    true = DAMPING * VEHICLE.mass
    every = [one for found in coefficients.values() for one in found]
    worlds = {
        world: [row for row in result["flights"] if row["world"] == world] for world in WORLDS
    }
    return result | {
        "worlds": worlds,
        "linear": coefficients["d"],
        "quadratic": coefficients["c"],
        "held": (sum(abs(x - true) <= 1.96 * std for x, std in every), len(every)),
        "true": true,
        "mass": VEHICLE.mass,
    }


def study() -> None:
    """Fly in each simulator, diagnose each flight, and keep the results."""
    code, flights = commit(), []
    for world in WORLDS:
        for seed in SEEDS:
            print(f"{world}, seed {seed}", flush=True)
            flights.append(diagnosed(world, seed))
    versions = {name: version(name) for name in ("pybullet", "rotorpy")}
    result = {"version": __version__, "commit": code, "versions": versions, "flights": flights}
    write_json(result, DOCS / RESULTS)
    print(DOCS / RESULTS)


if __name__ == "__main__":
    start(study)
