"""The task WindHover around another simulator: all but motors and rigid body is the kit's code.

Winds, start, disturbance and noise are those of the same seed here. The wind acts as the drag of
the kit's vehicle: at 12 stations, each by its own speed against the air. The filter gets the other
simulator's rotor speeds and a noisy pose, and knows the vehicle by its published parameters.
"""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics.rotation import quaternion_to_matrix
from windwrench.dynamics.vehicle import Vehicle
from windwrench.envs.closed_loop import ClosedLoop, Stage, World, accelerate
from windwrench.envs.fan import Fan
from windwrench.envs.plant import TICK, add_up, blow, disturb, log_speeds
from windwrench.envs.wind_tasks import WindHoverEnv
from windwrench.runtime.compiled import Record, compiled

from .peers import Peer

Array = NDArray[np.float64]


@compiled
def _press(record: Record, world: World, noise: Array, k: int) -> None:
    """Write a tick's external wrench, of wind and disturbance, into ``external``."""
    loop = record[0]
    quaternion_to_matrix(world.qpos[3:7], loop.plant.rotation)
    blow(loop.plant, loop.fan, world.jet, world.qpos, world.qvel, noise[k])
    disturb(loop.plant, noise[k])
    add_up(loop.plant, world.xfrc)


@compiled
def _report(record: Record, world: World, noise: Array, k: int, speeds: Array) -> None:
    """Log rotor speeds (4,), and the accelerometer by the force in ``xfrc``, mean of the run."""
    loop = record[0]
    plant, count = loop.plant, len(noise)
    for i in range(4):
        plant.speeds[i] = plant.sample[i] = speeds[i]
    log_speeds(plant, speeds)
    if k == 0:
        loop.specific[:] = 0.0
        loop.thrust[:] = 0.0
    accelerate(loop, world.xfrc, noise[k])
    if k == count - 1:
        for j in range(3):
            loop.specific[j] /= count
            loop.thrust[j] /= count
    plant.time += TICK


def _actuate(peer: Peer, loop: ClosedLoop) -> None:
    """Fly a tick in the other simulator."""
    world, vehicle = loop.world, peer.vehicle
    _press(loop.record, world, loop.noise, loop.row)
    before = loop.velocity.copy()
    pose, velocity, speeds = peer.step(loop.command, loop.external)
    world.qpos[:], world.qvel[:] = pose, velocity
    # what is not gravity, mean over the tick
    world.xfrc[:3] = vehicle.mass * (loop.velocity - before) / TICK
    world.xfrc[2] += vehicle.weight
    _report(loop.record, world, loop.noise, loop.row, np.ascontiguousarray(speeds))


def _move(loop: ClosedLoop) -> None:
    """Let MuJoCo's clock go on; the other simulator has moved the vehicle."""
    loop.data.time += TICK
    loop.record["ticks"] += 1


def _begin(peer: Peer, loop: ClosedLoop) -> None:
    """Put the other simulator's vehicle to the start of an episode."""
    if loop.data.time == 0.0:
        peer.start(loop.world.qpos)


class WindHoverElsewhere(WindHoverEnv):
    """WindHover with another simulator's vehicle.

    Args:
        peer: the simulator.
        **given: arguments of ``WindHoverEnv``; its vehicle is the peer's.
    """

    def __init__(self, peer: Peer, **given: Any) -> None:
        self.peer = peer
        begin = Stage("begin", partial(_begin, peer), before="wind")
        super().__init__(vehicle=peer.vehicle, stages=(begin,), **given)

    def make_loop(self, vehicle: Vehicle, fan: Fan, **given: Any) -> ClosedLoop:
        """Return the closed loop, whose motors and rigid body are the other simulator's."""
        loop = super().make_loop(vehicle, fan, **given)
        loop.stages["actuate"] = partial(_actuate, self.peer)
        loop.stages["move"] = _move
        return loop
