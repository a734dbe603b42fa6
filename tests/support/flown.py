"""Simulated flights with effects, and flights whose pose is lost."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from tests.support.vehicles import VEHICLE
from windwrench.dynamics import EffectSetting
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog

DRAG = {"kdx": 1.2e-4, "kdy": 1.2e-4}


def settings(effects):
    """Return effects of a vehicle from their coefficients by name."""
    return tuple(EffectSetting(name, dict(values)) for name, values in effects.items())


def recorded(
    trajectory="excite", seconds=20.0, seed=1, background=None, vehicle=VEHICLE, **effects
):
    """Return the log of a simulated flight with effects, each by its coefficients."""
    columns = record_flight(vehicle, settings(effects), trajectory, seconds, seed, background)
    return FlightLog(**columns, name="flight")


def resting(t, **columns):
    """Return the log of a vehicle at rest in the air, with some columns in place of its own."""
    n = len(t)
    own = {
        "position": np.tile([0.0, 0.0, 1.0], (n, 1)),
        "quaternion": np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        "rotor_speeds": np.full((n, 4), VEHICLE.hover_rate),
    }
    return FlightLog(t, **{**own, **columns})


def noisy(mocap, rng, position, quaternion, place=1.0, turn=1.0):
    """Return poses (..., 3) and (..., 4) with so many times the noise that is declared."""
    moved, turned = rng.standard_normal((2, *np.shape(position)))
    turns = Rotation.from_rotvec(turn * mocap.sigma_att_rad * turned)
    seen = turns * Rotation.from_quat(quaternion, scalar_first=True)
    return position + place * mocap.sigma_pos_m * moved, seen.as_quat(scalar_first=True)


def without_pose(log, rows):
    """Return a log whose poses are lost in some rows: a slice, or a mask (N,)."""
    pose = np.column_stack([log.position, log.quaternion])
    valid = log.valid.copy()
    pose[rows] = np.nan
    valid[rows] = False
    return replace(log, position=pose[:, :3], quaternion=pose[:, 3:], valid=valid)
