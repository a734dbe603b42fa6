"""The task WindHover around another simulator: all but motors and rigid body is the kit's code.

Winds, start, disturbance and noise are those of the same seed here. The wind acts as the drag of
the kit's vehicle: at 12 stations, each by its own speed against the air. The filter gets the other
simulator's rotor speeds and a noisy pose, and knows the vehicle by its published parameters.
"""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics.vehicle import Vehicle
from windwrench.envs.closed_loop import ACTUATE, FEEL, ClosedLoop, Stage
from windwrench.envs.fan import Fan
from windwrench.envs.plant import TICK
from windwrench.envs.wind_tasks import WindHoverEnv

from .peers import Peer

Array = NDArray[np.float64]


def _actuate(peer: Peer, loop: ClosedLoop) -> None:
    """Fly a tick in the other simulator; the accelerometer is by the force in ``xfrc``."""
    world, vehicle, plant = loop.world, peer.vehicle, loop.record[0]["plant"]
    loop.run_stage(ACTUATE)  # of which wind and disturbance are kept
    before = loop.velocity.copy()
    pose, velocity, speeds = peer.step(loop.command, loop.external)
    world.qpos[:], world.qvel[:] = pose, velocity
    # what is not gravity, mean over the tick
    world.xfrc[:3] = vehicle.mass * (loop.velocity - before) / TICK
    world.xfrc[2] += vehicle.weight
    plant["speeds"] = loop.unrounded[:] = loop.sample[:4] = speeds
    if plant["omega_lsb"] > 0.0:
        loop.sample[:4] = plant["omega_lsb"] * np.floor(speeds / plant["omega_lsb"] + 0.5)
    loop.run_stage(FEEL)


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
