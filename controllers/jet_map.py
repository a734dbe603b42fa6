"""A vehicle's wrench beside a fan's axis, and its variance: tables over its offset."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from .. import _core
from ..dynamics.effects import compile_effects
from ..dynamics.effects.base import STATE
from ..dynamics.mean_jet import (
    AIR_DENSITY,
    FIRST_X,
    HULL_RADIUS,
    HULL_STATIONS,
    STEP_R,
    STEP_X,
    jet_table,
)
from ..dynamics.vehicle import EffectSetting, Vehicle
from ..runtime.arrays import Array
from .briefing import Air, Jet

FIRST, STEP, COUNT = -3.0, 0.02, 301  # m, offsets of the tables
AXES = 3  # torque z, force x, force y
# m/s and rad/s, at which the slopes with the vehicle's own velocity and yaw rate are taken
_SIDEWAYS, _TURNING = 0.2, 0.3


@dataclass(frozen=True, eq=False)
class _JetMap:
    """Tables (AXES, COUNT) of ``tau_z`` (Nm), ``f_x`` and ``f_y`` (N), world, over the offset from
    the axis. The vehicle faces the fan at the height of the axis.
    """

    mean: Array  # for a vehicle at rest
    slope: Array  # per m/s of the vehicle's velocity along y
    turning: Array  # per rad/s of the vehicle's yaw rate
    gust: Array  # variance due to gusts


@lru_cache(maxsize=16)
def jet_map(vehicle: Vehicle, jet: Jet, air: Air) -> _JetMap:
    """Return the tables of a vehicle, from the effect model ``fan_jet`` at the vehicle's own
    stations. The gusts' variance follows from the drag at these stations, each in its own gust.
    """
    coefficients = {"u0": jet.u0, "x": 0.0, "y": 0.0, "z": 0.0, "kd": jet.kd, "area": jet.area}
    alone = replace(
        compile_effects(vehicle).vehicle, effects=(EffectSetting("fan_jet", coefficients),)
    )
    bundle = compile_effects(alone)
    (model,), (coefficients,) = bundle.wrench_models, bundle.wrench_coefficients
    numbers, wrench = np.zeros(STATE.itemsize // 8), np.zeros(6)
    state = numbers.view(STATE)[0]
    state["position"][0] = jet.distance
    state["rotation"] = np.diag([-1.0, -1.0, 1.0])  # it faces the fan
    offsets = FIRST + STEP * np.arange(COUNT, dtype=np.float64)

    def felt(velocity: float, rate: float) -> Array:
        table = np.empty((AXES, COUNT))
        state["velocity"][1], state["rate"][2] = velocity, rate
        for i, offset in enumerate(offsets):
            state["position"][1] = offset
            wrench[:] = 0.0
            _core.call_effect(model, coefficients, bundle.constants, numbers, wrench)
            table[:, i] = wrench[5], wrench[0], wrench[1]
        return table

    slope = (felt(_SIDEWAYS, 0.0) - felt(-_SIDEWAYS, 0.0)) / (2.0 * _SIDEWAYS)
    turning = (felt(0.0, _TURNING) - felt(0.0, -_TURNING)) / (2.0 * _TURNING)
    gust = _gust_variance(bundle.vehicle, jet, air, offsets)
    return _JetMap(felt(0.0, 0.0), slope, turning, gust)


def _gust_variance(vehicle: Vehicle, jet: Jet, air: Air, offsets: Array) -> Array:
    """Return the variance (AXES, n) of each axis from gusts of all three directions."""
    angles = np.arange(HULL_STATIONS) * math.pi / 4
    ring = HULL_RADIUS * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    # seen from above in the world: the vehicle faces -x
    places = -np.concatenate([vehicle.positions[:, :2], ring])
    distance = np.linalg.norm(places[:, None] - places[None], axis=2)
    together = np.exp(-distance / air.gust_length)
    axial, _ = jet_table(0.45, 0.10)
    row = (jet.distance + places[:, 0] - FIRST_X) / STEP_X
    i = np.clip(row.astype(int), 0, len(axial) - 2)
    fine = STEP_R * np.arange(axial.shape[1])
    share = (row - i)[:, None]
    profiles = (1.0 - share) * axial[i] + share * axial[i + 1]
    reach = np.abs(offsets[:, None] + places[:, 1])
    u = jet.u0 * np.stack(
        [np.interp(reach[:, n], fine, profiles[n]) for n in range(len(places))], axis=1
    )
    drag = 0.5 * AIR_DENSITY * jet.area / HULL_STATIONS * u
    along, across = 2.0 * drag, drag.copy()  # slopes of |u| u, along the wind and across it
    along[:, :4], across[:, :4] = jet.kd, jet.kd
    fx, fy = air.turbulence * u * along, air.turbulence * u * across  # (n, stations)

    def variance(shares: Array) -> Array:
        return np.asarray(np.einsum("ni,ij,nj->n", shares, together, shares))

    torque = variance(-places[:, 1] * fx) + variance(places[:, 0] * fy)
    return np.stack([torque, variance(fx), variance(fy)])
