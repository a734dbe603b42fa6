"""The same wind in other simulators, by stand-ins of what each of them documents."""

import sys
from types import SimpleNamespace

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from tests.support.outcomes import refused
from windwrench.envs.wind import (
    FanWall,
    PyFlytWind,
    RotorPyWind,
    Turbulence,
    WindDrag,
    blow_crazyflow,
    blow_pybullet_drones,
    pyflyt_wind_type,
)

rng = default_rng(3)
PLACE, VELOCITY, RATE = rng.normal(size=(3, 2, 3))
ROTATION = Rotation.random(2, rng)
ARM = 0.1
DRAG = 0.02


class Sheared:
    """Blows along x, faster with y and time."""

    def velocity(self, points, time):
        y = np.asarray(points)[:, 1]
        return np.column_stack([3.0 + 2.0 * y + time, 0.0 * y, 0.0 * y])


def test_pyflyt_and_rotorpy_get_the_same_field():
    wind = Turbulence(0, 1.0, 2.0, (4, 0, 0))
    points = default_rng(7).uniform(-1, 1, (5, 3))
    # as Aviary makes and asks for it
    field = pyflyt_wind_type(wind)(np_random=default_rng(0))
    for one in (field, PyFlytWind(wind)):
        assert_array_equal(one(0.4, points), wind.velocity(points, 0.4))
    wind = FanWall(np.full(9, 4.0))
    seen = RotorPyWind(wind).update(0.4, np.array([2.0, 0.1, 1.2]))
    assert_array_equal(seen, wind.velocity([[2.0, 0.1, 1.2]], 0.4)[0])


def still(time=0.0):
    """Return the drag of vehicles at their places that neither move nor turn."""
    zero = np.zeros((2, 3))
    return WindDrag(Sheared(), ARM, DRAG).wrench(time, PLACE, Rotation.identity(2), zero, zero)


def test_a_wind_pushes_and_a_shear_turns():
    force, torque = still(time=0.5)
    along = 4.0 * DRAG * (3.5 + 2.0 * PLACE[:, 1])
    assert_allclose(force, np.column_stack([along, 0 * along, 0 * along]), atol=1e-12)
    # sum of -y F_x over four rotors at y = arm / sqrt 2
    assert_allclose(torque, [[0, 0, -4 * DRAG * 2.0 * ARM**2 / 2]] * 2, atol=1e-12)
    calm = WindDrag(Turbulence(0, 1e-12, 1.0, (1, 0, 0)), ARM, DRAG)
    force, torque = calm.wrench(0.0, PLACE, ROTATION, VELOCITY, RATE)
    assert_allclose(force, -4 * DRAG * VELOCITY, atol=1e-10)
    assert (np.sum(torque * RATE, axis=1) < 0.0).all()  # drag brakes


def expected(time):
    return WindDrag(Sheared(), ARM, DRAG).wrench(time, PLACE, ROTATION, VELOCITY, RATE)


class Leaf:
    """Zeros with JAX's ``at[:].set``."""

    shape = (2, 1, 3)
    set = staticmethod(np.asarray)
    at = property(lambda self: self)

    def __getitem__(self, key):
        return self


class Tree(SimpleNamespace):
    def replace(self, **new):
        return Tree(**{**vars(self), **new})


def test_crazyflow_gets_force_and_torque_of_all_worlds():
    body_rate = ROTATION.inv().apply(RATE)
    parts = {"pos": PLACE, "quat": ROTATION.as_quat(), "vel": VELOCITY, "ang_vel": body_rate}
    moving = {name: part[:, None] for name, part in parts.items()}
    states = Tree(**moving, force=Leaf(), torque=Leaf())
    data = Tree(states=states, core=Tree(steps=np.full((2, 1), 250), freq=500))
    blown = blow_crazyflow(data, WindDrag(Sheared(), ARM, DRAG)).states
    for seen, wanted in zip((blown.force, blown.torque), expected(0.5), strict=True):
        assert_allclose(seen[:, 0], wanted, atol=1e-12)
    assert blown.pos is states.pos


def test_pybullet_drones_get_force_and_torque(monkeypatch):
    forces = []
    torques = []
    bullet = SimpleNamespace(
        WORLD_FRAME=2,
        applyExternalForce=lambda *given: forces.append(np.hstack(given)),
        applyExternalTorque=lambda *given: torques.append(np.hstack(given)),
    )
    monkeypatch.setitem(sys.modules, "pybullet", bullet)
    env = SimpleNamespace(
        PYB_STEPS_PER_CTRL=1,
        PYB_FREQ=240,
        CTRL_FREQ=240,
        PYB_TIMESTEP=1 / 240,
        step_counter=120,
        pos=PLACE,
        quat=ROTATION.as_quat(),
        vel=VELOCITY,
        ang_v=RATE,
        DRONE_IDS=np.array([4, 5]),
        CLIENT=1,
    )
    drag = WindDrag(Sheared(), ARM, DRAG)
    blow_pybullet_drones(env, drag)
    force, torque = expected(0.5)
    for i, body in enumerate(env.DRONE_IDS):
        assert_allclose(forces[i], [body, -1, *force[i], *PLACE[i], 2, 1])
        assert_allclose(torques[i], [body, -1, *torque[i], 2, 1])
    env.PYB_STEPS_PER_CTRL = 5
    env.CTRL_FREQ = 48
    with refused("expected ctrl_freq equal to pyb_freq, got 48 and 240 Hz"):
        blow_pybullet_drones(env, drag)
