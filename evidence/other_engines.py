"""Flights in other people's simulators: what does a diagnosis find of a drag that nobody asked for?

PyBullet (E. Coumans and Y. Bai) is the engine of several drone simulators, RotorPy (S. Folk,
J. Paulos and V. Kumar, 2023) one of its own. A Hummingbird without any aerodynamics flies 40 s of
sines there under this kit's flight loop. Its pose, with the noise of motion capture, and its rotor
speeds are diagnosed. PyBullet slows a free body by ``DAMPING`` (1 + |v|) v unless its damping is
set to zero. ``python -m evidence.other_engines`` needs ``pip install pybullet rotorpy``.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from windwrench import __version__, _core
from windwrench.controllers.flight import BESIDE, flight_record
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.estimator.estimate import STATE_SIZE
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.runner import start
from windwrench.evidence.sim_to_sim.peers import simulator
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit

Array = NDArray[np.float64]
# rotor speeds that are commanded (4,) -> state (13,) after a period, and rotor speeds (4,) in it
Step = Callable[[Array], tuple[Array, Array]]

VEHICLE = load_vehicle("hummingbird")
SECONDS, PERIOD, SEEDS = 40.0, 0.01, 5
CENTRE = np.array([0.0, 0.0, 4.0])  # m, of the path: far from the ground
RESULTS = "results/other_engines.json"  # below docs/
DAMPING = 0.04  # 1/s and 1/m, as bodies show that are let go at 0.5 to 4 m/s
_SUBSTEPS = 5  # of PyBullet in a period
_FREQUENCIES = 2.0 * np.pi * np.array([[0.11, 0.13, 0.17], [0.29, 0.23, 0.31]])  # rad/s
_SIZES = np.array([[1.6, 1.4, 0.5], [0.35, 0.4, 0.25]])  # m


def in_pybullet(damped: bool) -> Step:
    """Return a step of a rigid body in PyBullet; ``damped``: with the engine's own damping.

    Raises:
        InputError: PyBullet is not installed.
    """
    bullet = simulator("pybullet", "pip install pybullet")
    client = simulator("pybullet_utils.bullet_client", "pip install pybullet")
    world = client.BulletClient(bullet.DIRECT)
    world.setGravity(0.0, 0.0, -VEHICLE.gravity)
    world.setTimeStep(PERIOD / _SUBSTEPS)
    body = world.createMultiBody(VEHICLE.mass, -1, -1, CENTRE.tolist())
    world.changeDynamics(body, -1, localInertiaDiagonal=np.diagonal(VEHICLE.inertia).tolist())
    if not damped:
        world.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)

    def step(speeds: Array) -> tuple[Array, Array]:
        thrust, *torque = VEHICLE.rotor_wrench(speeds).tolist()
        for _ in range(_SUBSTEPS):
            _, q = world.getBasePositionAndOrientation(body)
            turned = Rotation.from_quat(q).apply(torque).tolist()
            world.applyExternalForce(body, -1, [0, 0, thrust], [0, 0, 0], bullet.LINK_FRAME)
            world.applyExternalTorque(body, -1, turned, bullet.WORLD_FRAME)
            world.stepSimulation()
        p, q = world.getBasePositionAndOrientation(body)
        v, w = world.getBaseVelocity(body)
        return np.hstack([p, np.roll(q, 1), v, Rotation.from_quat(q).inv().apply(w)]), speeds

    return step


def in_rotorpy() -> Step:
    """Return a step of RotorPy's quadrotor with rotors of 5 ms and no aerodynamics.

    Raises:
        InputError: RotorPy is not installed.
    """
    package = simulator("rotorpy.vehicles.multirotor", "pip install rotorpy")
    arm = VEHICLE.arm_l
    corners = [(arm, arm), (-arm, arm), (-arm, -arm), (arm, -arm)]
    absent = "Ixy Iyz Ixz c_Dx c_Dy c_Dz k_d k_z k_h k_flap motor_noise_std rotor_speed_min"
    plane = package.Multirotor(
        {
            **dict.fromkeys(absent.split(), 0.0),
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

    def step(speeds: Array) -> tuple[Array, Array]:
        nonlocal now
        before = now["rotor_speeds"]
        now = plane.step(now, {"cmd_motor_speeds": speeds}, PERIOD)
        state = np.hstack([now["x"], np.roll(now["q"], 1), now["v"], now["w"]])
        return state, 0.5 * (before + now["rotor_speeds"])

    return step


ENGINES: Mapping[str, Callable[[], Step]] = {
    "PyBullet": lambda: in_pybullet(True),
    "PyBullet, damping set to zero": lambda: in_pybullet(False),
    "RotorPy": in_rotorpy,
}


def flight(step: Step, seed: int) -> FlightLog:
    """Return a flight along sines, with the noise of the vehicle's motion capture."""
    generator = np.random.default_rng(seed)
    phase = generator.uniform(0.0, 2.0 * np.pi, (2, 3))
    loop = flight_record(VEHICLE)[0]
    state = np.zeros(STATE_SIZE)
    state[:3], state[3] = CENTRE, 1.0
    rows = []
    for i in range(round(SECONDS / PERIOD)):
        now = i * PERIOD
        begun = min(now / 3.0, 1.0)  # the path grows from its centre
        angle = _FREQUENCIES * now + phase
        loop["setpoint"][:3] = CENTRE + begun * (_SIZES * np.sin(angle)).sum(axis=0)
        speed = _SIZES * _FREQUENCIES * np.cos(angle)
        loop["setpoint"][3:6] = begun * speed.sum(axis=0)
        loop["setpoint"][6:9] = -begun * (_SIZES * _FREQUENCIES**2 * np.sin(angle)).sum(axis=0)
        loop["setpoint"][9:] = 0.6 * np.sin(0.44 * now), 0.264 * np.cos(0.44 * now)
        _core.steer(np.asarray(loop).ctypes.data, state, np.zeros(4), BESIDE, PERIOD)
        state[:13], speeds = step(loop["command"].copy())
        rows.append(np.hstack([now + PERIOD, state[:7], speeds]))
    t, position, quaternion, rotor_speeds = np.split(np.array(rows), [1, 4, 8], axis=1)
    noise = generator.normal(size=(2, len(t), 3))
    turns = Rotation.from_rotvec(VEHICLE.mocap.sigma_att_rad * noise[0])
    return FlightLog(
        t[:, 0],
        position + VEHICLE.mocap.sigma_pos_m * noise[1],
        (Rotation.from_quat(quaternion, scalar_first=True) * turns).as_quat(scalar_first=True),
        rotor_speeds,
        name=f"seed {seed}",
    )


def diagnosed(engine: str, seed: int) -> dict[str, Any]:
    """Return what a diagnosis says of one flight."""
    print(f"{engine}, seed {seed}", flush=True)
    found = diagnose([flight(ENGINES[engine](), seed)], VEHICLE)
    return {
        "engine": engine,
        "verdict": found.verdict,
        "unknown": found.probabilities.unknown,
        "effects": [
            {
                "name": e.name,
                "sure": not e.tentative,
                "coefficients": dict(e.coefficients),
                "std": dict(e.std),
            }
            for e in found.effects
        ],
    }


def study() -> None:
    """Fly in each simulator, diagnose each flight, and keep the results."""
    code = commit()
    flights = [diagnosed(engine, seed) for engine in ENGINES for seed in range(SEEDS)]
    write_json({"version": __version__, "commit": code, "flights": flights}, DOCS / RESULTS)
    print(DOCS / RESULTS)


if __name__ == "__main__":
    start(study)
