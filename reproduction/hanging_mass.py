"""Closed-loop hover with the paper's 53 g mass on a thread, flown for Fig. 3 and Fig. 4.

The mass is hung on the nose side: under rotors 1 and 4, the front pair, at ``ARM`` on body +x. With
x forward and z up its weight then is f_z = -0.52 N and tau_y = -x f_z = +0.067 Nm, which pitches
the nose down. Force and torque are given in the world frame turned by the vehicle's heading (z up,
y to its left, both level): the vehicle holds yaw 0, but unmodelled actuator torque lets it wander
by up to 0.1 rad, and the load with it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..controllers.flight import FlightGains
from ..dynamics.vehicle import Vehicle
from ..envs.plant import NOISE, TICK, PlantSettings
from ..estimator.estimate import FORCE as FORCE_STATE
from ..estimator.estimate import TORQUE as TORQUE_STATE
from ..estimator.tuning import UKFTuning
from ..runtime.errors import InputError
from .suspended_load import LoadedLoop, SuspendedLoad

Array = NDArray[np.float64]

MASS = 0.053  # kg, of the paper
FORCE, TORQUE = -0.52, 0.067  # N along world z, Nm about world y: the paper's targets
ARM = TORQUE / -FORCE  # m: 0.129, of the paper's two targets; our rotor axes lie at 0.126
# m. A thread pulls sideways by weight * displacement / length when the vehicle slides from over the
# mass, in a real flight too. On 0.25 m, whose pendulum of 1 s the position loop follows, it pulled
# sideways by up to 0.24 N.
THREAD = 1.0
CENTRE_LOAD = SuspendedLoad(MASS, (0.0, 0.0, -0.02), length=THREAD)
ROTOR_LOAD = SuspendedLoad(MASS, (ARM, 0.0, -0.02), length=THREAD)
# A proportional attitude loop tips by torque / (inertia * gain) when the mass is hung on, and flies
# sideways until its position integral has found the trim; the benchmark's 110 1/s2 tips by 0.2 rad.
# Its yaw loop of 3.5 rad/s would meet the pendulum of a thread of 1 m, 3.1 rad/s, through the arm.
GAINS = FlightGains(attitude=300.0, rate=32.0, yaw=30.0, yaw_rate=10.0, yaw_integral=10.0)
CALM = PlantSettings(
    disturbance_force=0.0, disturbance_torque=0.0
)  # rotors that do as they are told
_START = np.array([0.0, 0.0, 1.5])  # m


@dataclass(frozen=True)
class Hover:
    """One flight; forces in N and torques in Nm, along the vehicle's heading, to
    its left, and up.
    """

    time: Array  # (n,) s
    wrench: Array  # (n, 6) force and torque, estimated
    pull: Array  # (n, 6) force and torque of the thread, as they really are
    actuator: Array  # (n, 6) of the unmodelled actuator noise, as they really are

    def between(self, start: float, stop: float) -> NDArray[np.bool_]:
        """Return which samples (n,) lie in the time from ``start`` to ``stop`` s."""
        # samples lie on ticks: half a tick keeps rounding out
        inside: NDArray[np.bool_] = (self.time >= start - TICK / 2) & (self.time < stop - TICK / 2)
        return inside


def hover(
    vehicle: Vehicle,
    load: SuspendedLoad | None,
    seconds: float,
    hang_at: float,
    seed: int,
    rise_time: float = 1.0,
    settings: PlantSettings | None = None,
    every: int = 10,
) -> Hover:
    """Hover for ``seconds`` s with the load hung on at ``hang_at`` s; return every ``every``-th
    estimate.

    Args:
        vehicle: as declared, and as it is; its motion capture and logged rotor speeds are the
            flight's.
        load: None: nothing is hung on.
        seconds: length of the flight.
        hang_at: s, a multiple of ``every`` ticks.
        seed: of everything random; flights with equal seeds see equal noise, whatever their
            settings.
        rise_time: s, 10-90 %, that the filter is tuned for.
        settings: of the plant.
        every: ticks from one returned sample to the next.

    Raises:
        InputError: the vehicle fell.
    """
    tuning = UKFTuning.for_vehicle(vehicle, TICK, rise_time)
    loop = LoadedLoop(vehicle, tuning=tuning, settings=settings, gains=GAINS, load=load)
    rng = np.random.default_rng(seed)
    loop.reset(rng, _START)
    count, hang_tick = round(seconds / TICK / every), round(hang_at / TICK / every)
    time, heading = np.empty(count), np.empty(count, dtype=np.complex128)
    wrench, actuator, pull = np.empty((count, 6)), np.empty((count, 6)), np.zeros((count, 6))
    for k in range(count):
        if k == hang_tick and load is not None:
            loop.hang_load()
        loop.run(rng.standard_normal((every, NOISE)))
        time[k], wrench[k, :3], wrench[k, 3:] = (
            loop.time,
            loop.state[FORCE_STATE],
            loop.state[TORQUE_STATE],
        )
        heading[k], actuator[k] = _heading(loop.quaternion), loop.external
        if k >= hang_tick and load is not None:
            pull[k] = loop.load_pull()
    if not loop.healthy() or loop.position[2] < 0.0:
        raise InputError(f"{vehicle.name} cannot hover with {MASS * 1e3:.0f} g on a thread")
    for vectors in (whole.reshape(count, 2, 3) for whole in (wrench, actuator, pull)):
        level = (vectors[..., 0] + 1j * vectors[..., 1]) * heading[:, None].conj()
        vectors[..., 0], vectors[..., 1] = level.real, level.imag
    return Hover(time, wrench, pull, actuator)


def _heading(q: Array) -> complex:
    """Return where the nose of an attitude (4,) points, x + iy of length 1, seen from above."""
    nose = complex(1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]), 2.0 * (q[1] * q[2] + q[0] * q[3]))
    return nose / abs(nose)
