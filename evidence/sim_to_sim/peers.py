"""Two other simulators behind one interface: rotor commands and an external wrench in, motion out.

Rigid body, motors, limits and integrator are the simulator's own. Its rotors are numbered from the
front right, clockwise as seen from above less one: the kit's order read backwards.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics.rotation import matrix_of
from windwrench.dynamics.vehicle import Vehicle
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.envs.plant import TICK
from windwrench.runtime.errors import InputError

Array = NDArray[np.float64]
RPM = 60.0 / (2.0 * np.pi)  # of 1 rad/s
# steps of a tick, the fewest at or above each simulator's own 500 and 240 Hz
_CRAZYFLOW_STEPS, _PYBULLET_STEPS = 3, 2
# crazyflow's states in a vector
_STATE, _WRENCH = ("pos", "quat", "vel", "ang_vel", "rotor_vel"), ("force", "torque")
_SCALAR_FIRST, _SCALAR_LAST = [3, 0, 1, 2], [1, 2, 3, 0]


class Flown(NamedTuple):
    """The motion at the end of a tick."""

    pose: Array  # (7,) m and quaternion, body to world, scalar first
    velocity: Array  # (6,) m/s, world, and rad/s, body
    speeds: Array  # (4,) rad/s of the rotors, in the kit's order


class Peer(Protocol):
    """A simulator of one quadrotor."""

    vehicle: Vehicle  # by the simulator's published parameters

    def start(self, pose: Array) -> None:
        """Hover at a pose (7,) with the rotors at hover."""

    def step(self, command: Array, wrench: Array) -> Flown:
        """Fly a tick of 5 ms.

        Args:
            command: (4,) rad/s, of the rotors.
            wrench: (6,) N and Nm, world, about the centre of mass, held over the tick.
        """


def simulator(module: str, install: str) -> Any:
    """Return a simulator's module.

    Raises:
        InputError: the simulator is not installed.
    """
    try:
        return import_module(module)
    except (ImportError, RuntimeError) as error:
        package = module.partition(".")[0]
        raise InputError(f"{package} cannot be imported ({error}); expected {install}") from error


def vehicle_of(name: str) -> Vehicle:
    """Return the vehicle of a simulator by its published parameters."""
    return load_vehicle(Path(__file__).with_name(f"{name}.yaml"))


class Crazyflow:
    """crazyflow 0.4.0, dynamics ``first_principles``, its default Crazyflie ``cf21B_500``.

    Explicit Euler, its default, at 600 Hz in single precision. Own drag, gyroscopic and reaction
    torque of the propellers, thrust curve and motors are on.

    Args:
        motor_lag: s, of a first-order motor in place of the simulator's own; None: its own.

    Raises:
        InputError: crazyflow is not installed.
    """

    def __init__(self, motor_lag: float | None = None) -> None:
        package = simulator("crazyflow.sim.sim", "pip install 'crazyflow==0.4.0' 'jax<0.10.2'")
        jax = import_module("jax")
        self.vehicle = vehicle_of(VEHICLES["crazyflow"])
        hz = round(_CRAZYFLOW_STEPS / TICK)
        sim = package.Sim(dynamics="first_principles", control="rotor_vel", freq=hz, device="cpu")
        data = sim.data
        if motor_lag is not None:
            ours = np.array([1.0 / motor_lag, 0.0, 1.0 / motor_lag, 0.0])
            params = data.params
            coefficients = params.rotor_dyn_coef.at[...].set(ours)
            data = data.replace(params=params.replace(rotor_dyn_coef=coefficients))
        step = sim.build_step_fn()

        def tick(x: Any, given: Any) -> Any:
            """Return the state (17,) after a tick, from a state and commands and wrench (10,)."""
            states = data.states.replace(
                **_split(x, data.states, _STATE), **_split(given[4:], data.states, _WRENCH)
            )
            controls = data.controls.replace(rotor_vel=given[:4][None, None])
            s = step(
                data.replace(states=states, controls=controls), n_steps=_CRAZYFLOW_STEPS
            ).states
            return jax.numpy.concatenate([getattr(s, name).ravel() for name in _STATE])

        self._tick = jax.jit(tick)

    def start(self, pose: Array) -> None:
        """Hover at a pose (7,) with the rotors at hover."""
        rotors, quaternion = np.full(4, self.vehicle.hover_rate * RPM), pose[3:][_SCALAR_LAST]
        self._x = np.concatenate([pose[:3], quaternion, np.zeros(6), rotors]).astype(np.float32)

    def step(self, command: Array, wrench: Array) -> Flown:
        """Fly a tick, as of ``Peer``."""
        given = np.concatenate([command[::-1] * RPM, wrench]).astype(np.float32)
        self._x = np.asarray(self._tick(self._x, given))
        x = self._x.astype(np.float64)
        quaternion = x[3:7][_SCALAR_FIRST]
        pose = np.concatenate([x[:3], quaternion / np.linalg.norm(quaternion)])
        return Flown(pose, x[7:13], x[:12:-1] / RPM)


def _split(x: Any, states: Any, names: tuple[str, ...]) -> dict[str, Any]:
    """Return the parts of a vector by their names, in the shapes of crazyflow's states."""
    parts, first = {}, 0
    for name in names:
        shape = getattr(states, name).shape
        parts[name] = x[first : first + shape[-1]].reshape(shape)
        first += shape[-1]
    return parts


class PyBulletDrones:
    """gym-pybullet-drones at commit 90b178a with PyBullet 3.2.7: ``CtrlAviary``, its ``CF2X``.

    ``Physics.PYB`` at 400 Hz. Rotors have no lag, and no drag but PyBullet's own damping.

    Args:
        motor_lag: s, of a first-order motor before the simulator's rotors; None: none.

    Raises:
        InputError: the simulator is not installed.
    """

    def __init__(self, motor_lag: float | None = None) -> None:
        install = (
            "pip install 'pybullet==3.2.7' transforms3d 'setuptools<80', and a checkout of "
            "github.com/learnsyslab/gym-pybullet-drones on PYTHONPATH"
        )
        package = simulator("gym_pybullet_drones.envs.CtrlAviary", install)
        self._bullet = import_module("pybullet")
        self.vehicle = vehicle_of(VEHICLES["pybullet"])
        hz = round(_PYBULLET_STEPS / TICK)
        self._keep = 0.0 if motor_lag is None else float(np.exp(-1.0 / (hz * motor_lag)))
        self._env = package.CtrlAviary(pyb_freq=hz, ctrl_freq=hz, gui=False, record=False)

    def start(self, pose: Array) -> None:
        """Hover at a pose (7,) with the rotors at hover."""
        env, bullet = self._env, self._bullet
        env.reset()
        body, client = int(env.DRONE_IDS[0]), env.CLIENT
        quaternion = pose[3:][_SCALAR_LAST]
        bullet.resetBasePositionAndOrientation(body, pose[:3], quaternion, physicsClientId=client)
        bullet.resetBaseVelocity(body, [0.0] * 3, [0.0] * 3, physicsClientId=client)
        env._updateAndStoreKinematicInformation()
        self._speeds = np.full(4, self.vehicle.hover_rate)

    def step(self, command: Array, wrench: Array) -> Flown:
        """Fly a tick, as of ``Peer``."""
        env, bullet = self._env, self._bullet
        body, client, world = int(env.DRONE_IDS[0]), env.CLIENT, bullet.WORLD_FRAME
        force, torque = wrench[:3].tolist(), wrench[3:].tolist()
        for _ in range(_PYBULLET_STEPS):
            self._speeds = command + self._keep * (self._speeds - command)
            at = env.pos[0].tolist()
            bullet.applyExternalForce(body, -1, force, at, world, physicsClientId=client)
            bullet.applyExternalTorque(body, -1, torque, world, physicsClientId=client)
            env.step(self._speeds[None, ::-1] * RPM)
        quaternion = env.quat[0][_SCALAR_FIRST]
        rate = matrix_of(quaternion).T @ env.ang_v[0]
        pose, velocity = np.hstack([env.pos[0], quaternion]), np.hstack([env.vel[0], rate])
        return Flown(pose, velocity, env.last_clipped_action[0, ::-1] / RPM)


VEHICLES = {"crazyflow": "cf21b_500", "pybullet": "cf2x"}  # files beside this one
OURS = 0.04  # s, motor lag of the kit's plant
PEERS: dict[str, Callable[[], Peer]] = {
    "crazyflow": Crazyflow,
    "crazyflow-our-motors": partial(Crazyflow, OURS),
    "pybullet": PyBulletDrones,
    "pybullet-our-motors": partial(PyBulletDrones, OURS),
}
