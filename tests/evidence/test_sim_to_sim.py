"""The hover in another simulator: the kit's plant as a peer flies the kit's own episode, and each
simulator that is installed obeys its published vehicle.
"""

import mujoco
import numpy as np
import pytest
from numpy.random import default_rng

from tests.support.outcomes import refused
from windwrench.dynamics import InputError, load_vehicle
from windwrench.dynamics.rotation import matrix_of
from windwrench.envs.plant import SUBSTEPS, TICK, load_world
from windwrench.envs.wind_tasks import WindHoverEnv
from windwrench.evaluation.episodes import fly_episode
from windwrench.evaluation.tasks import make_pilot
from windwrench.evidence.sim_to_sim.__main__ import ranking
from windwrench.evidence.sim_to_sim.flight import WindHoverElsewhere
from windwrench.evidence.sim_to_sim.peers import OURS, PEERS, Flown, simulator


class Ours:
    """The kit's motors and MuJoCo, behind the interface of another simulator."""

    vehicle = load_vehicle("crazyflie")

    def start(self, pose):
        self.model, self.data = load_world(self.vehicle, False)
        self.data.qpos[:], self.speeds = pose, self.vehicle.hover_rate

    def step(self, command, wrench):
        data = self.data
        self.speeds = command + np.exp(-TICK / OURS) * (self.speeds - command)
        thrust, *torque = self.vehicle.rotor_wrench(self.speeds)
        turn = matrix_of(data.qpos[3:])
        data.xfrc_applied[-1] = wrench + np.hstack([turn[:, 2] * thrust, turn @ torque])
        mujoco.mj_step(self.model, data, SUBSTEPS)
        return Flown(data.qpos, data.qvel, self.speeds)


def test_the_kits_plant_as_a_peer_flies_the_kits_episode():
    here, there = (
        fly_episode(env, make_pilot("lqg", "WindHover"), seed=3, decisions=60)
        for env in (WindHoverEnv(vehicle="crazyflie"), WindHoverElsewhere(Ours()))
    )
    for name in ("position", "estimate", "force", "observation"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), atol=1e-6)


def test_a_missing_simulator_is_told_with_its_installation():
    with refused(r"nowhere cannot be imported .*; expected pip install"):
        simulator("nowhere.sim", "pip install nowhere")


@pytest.mark.parametrize("name", PEERS)
def test_a_simulator_obeys_its_published_vehicle(name):
    """A wrench accelerates and turns it, hover is hover, and each rotor turns it to its side."""
    try:
        peer = PEERS[name]()
    except InputError as error:
        pytest.skip(str(error))
    vehicle = peer.vehicle
    facing_back = np.array([2.0, 0.0, 1.5, 0.0, 0.0, 0.0, 1.0])
    hover = np.full(4, vehicle.hover_rate)
    push = 0.1 * vehicle.weight * np.arange(1.0, 4.0)
    peer.start(facing_back)
    _, velocity, speeds = peer.step(hover, np.hstack([push, 0.01 * push]))
    turned = 0.01 * push * [-1.0, -1.0, 1.0] / np.diag(vehicle.inertia)
    wanted = TICK * np.hstack([push / vehicle.mass, turned])
    np.testing.assert_allclose(velocity, wanted, rtol=0.02, atol=1e-4)
    np.testing.assert_allclose(speeds, hover, rtol=1e-3)
    for command in hover + 200.0 * np.eye(4):
        peer.start(facing_back)
        for _ in range(4):
            velocity, speeds = peer.step(command, np.zeros(6))[1:]
        assert speeds.argmax() == command.argmax()
        assert (np.sign(velocity[3:]) == np.sign(vehicle.rotor_wrench(command)[1:])).all()


def test_clear_pairs_that_turn_round_are_counted():
    noise = 0.01 * default_rng(0).standard_normal((3, 40))
    found = ranking(np.array([[1], [2], [2]]) + noise, np.array([[2], [1], [3]]) + noise)
    assert (found["pairs"], found["clear_pairs"], found["clear_pairs_reversed"]) == (3, 2, 1)
