"""The same wind in other simulators, without an import of any.

PyFlyt and RotorPy ask for the wind at points of the world in m, z up, and take m/s, as these winds
do. crazyflow and gym-pybullet-drones take force and torque: those of ``WindDrag``. A simulator's
own drag comes on top.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ...runtime.arrays import Array
from ...runtime.errors import InputError
from .field import Wind


class PyFlytWind:
    """A wind as PyFlyt's ``WindFieldClass``: called with the time and positions (n, 3).

    ``Aviary(..., wind_type=pyflyt_wind_type(wind))``, or
    ``aviary.register_wind_field_function(PyFlytWind(wind))``.

    Args:
        wind: any.
        np_random: PyFlyt's generator, not used: a wind has a seed of its own.
    """

    def __init__(self, wind: Wind, np_random: np.random.Generator | None = None) -> None:
        self.wind, self.np_random = wind, np_random

    def __call__(self, time: float, position: ArrayLike) -> Array:
        """Return the wind (n, 3) m/s at positions (n, 3) m and a time in s."""
        return np.asarray(self.wind.velocity(position, float(time)), dtype=np.float64)


def pyflyt_wind_type(wind: Wind) -> Callable[..., Any]:
    """Return a class of this wind, for PyFlyt's ``wind_type``.

    With PyFlyt installed the class counts as one of its ``WindFieldClass``.
    """

    class _Field(PyFlytWind):
        def __init__(self, np_random: np.random.Generator | None = None) -> None:
            super().__init__(wind, np_random)

    try:
        from PyFlyt.core.abstractions import WindFieldClass
    except ImportError:
        return _Field
    WindFieldClass.register(_Field)
    return _Field


class RotorPyWind:
    """A wind as RotorPy's ``wind_profile``: ``update(t, position)`` with one position (3,).

    Args:
        wind: any.
    """

    def __init__(self, wind: Wind) -> None:
        self.wind = wind

    def update(self, t: float, position: ArrayLike) -> Array:
        """Return the wind (3,) m/s at a position (3,) m and a time in s."""
        at = np.asarray(position, dtype=np.float64).reshape(1, 3)
        seen: Array = np.asarray(self.wind.velocity(at, float(t)), dtype=np.float64)[0]
        return seen


_CORNERS = np.sqrt(0.5) * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])


@dataclass(frozen=True)
class WindDrag:
    """Drag of quadrotors in a wind: linear for each rotor, in the air at the rotor."""

    wind: Wind
    arm: float  # m, from the centre to each rotor
    drag: float  # N/(m/s), of one rotor

    def wrench(
        self, time: float, position: Array, rotation: Rotation, velocity: Array, rate: Array
    ) -> tuple[Array, Array]:
        """Return force (n, 3) N and torque (n, 3) Nm about the centre, world, on n vehicles.

        Args:
            time: s.
            position: (n, 3) m, world.
            rotation: body to world.
            velocity: (n, 3) m/s, world.
            rate: (n, 3) rad/s, world.
        """
        reach = np.stack([rotation.apply(self.arm * corner) for corner in _CORNERS], axis=1)
        points = (position[:, None] + reach).reshape(-1, 3)
        air = np.asarray(self.wind.velocity(points, time)).reshape(reach.shape)
        force = self.drag * (air - velocity[:, None] - np.cross(rate[:, None], reach))
        return force.sum(axis=1), np.cross(reach, force).sum(axis=1)


def blow_crazyflow(data: Any, drag: WindDrag) -> Any:
    """Return crazyflow's ``SimData`` with force and torque of the wind, for all worlds and drones:
    ``sim.data = blow_crazyflow(sim.data, drag)`` before each ``sim.step``.

    Tested with crazyflow 0.4.0.
    """
    s, time = data.states, float(data.core.steps.max()) / data.core.freq
    position, quaternion, velocity, rate = (
        np.asarray(part, dtype=np.float64).reshape(-1, part.shape[-1])
        for part in (s.pos, s.quat, s.vel, s.ang_vel)
    )
    rotation = Rotation.from_quat(quaternion)
    force, torque = drag.wrench(time, position, rotation, velocity, rotation.apply(rate))
    force, torque = force.reshape(s.force.shape), torque.reshape(s.torque.shape)
    return data.replace(
        states=s.replace(force=s.force.at[:].set(force), torque=s.torque.at[:].set(torque))
    )


def blow_pybullet_drones(env: Any, drag: WindDrag) -> None:
    """Apply force and torque of the wind to all drones of a ``BaseAviary`` of gym-pybullet-drones,
    before each ``env.step``.

    Tested with its commit 90b178a and PyBullet 3.2.7.

    Raises:
        InputError: several physics steps a control step; only the first would feel the wind.
    """
    import pybullet

    if env.PYB_STEPS_PER_CTRL != 1:
        raise InputError(
            "blow_pybullet_drones: expected ctrl_freq equal to pyb_freq, got "
            f"{env.CTRL_FREQ} and {env.PYB_FREQ} Hz"
        )
    time, rotation = env.step_counter * env.PYB_TIMESTEP, Rotation.from_quat(env.quat)
    force, torque = drag.wrench(time, env.pos, rotation, env.vel, env.ang_v)
    for body, at, f, t in zip(env.DRONE_IDS, env.pos, force, torque, strict=True):
        pybullet.applyExternalForce(body, -1, f, at, pybullet.WORLD_FRAME, env.CLIENT)
        pybullet.applyExternalTorque(body, -1, t, pybullet.WORLD_FRAME, env.CLIENT)
