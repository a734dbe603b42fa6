"""A log without its vehicle's declared sensing effects: true poses and rotor speeds.

Every comparison of a log's motion with a model takes the corrected log. Only the filter takes the
log as it is: it undoes these effects itself.
"""

from dataclasses import replace

import numpy as np

from ... import _core
from ...dynamics.effects import Role, get
from ...dynamics.effects.own import raise_errors
from ...dynamics.vehicle import EffectSetting, Vehicle
from ..logs.flight_log import FlightLog
from .residual import loaded_model
from .signals import LONGEST_GAP, voltage_at


def sensing_of(vehicle: Vehicle) -> tuple[EffectSetting, ...]:
    """Return a vehicle's effects on a log's poses."""
    return tuple(e for e in vehicle.effects if get(e.name).kind == "sensing")


def delay_of(vehicle: Vehicle) -> float:
    """Return the delay (s) of rows without a vehicle's sensing effects behind the flight."""
    every = ((get(e.name), e.coefficients) for e in sensing_of(vehicle))
    return float(sum(abs(e.vector(given)[0]) for e, given in every if e.role == Role.DELAY))


def undo_log_sensing(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with the vehicle's declared sensing effects taken out of its poses and rotor
    speeds.

    Without declared ones it is the log itself. With a delay of dt between the clocks, the rows show
    the flight of abs(dt) ago, like the filter's estimate. The first abs(dt) s after a break of more
    than 0.1 s have no pose. The voltage, of the row's own instant before, is of the same past
    instant; the truth stays as it is.
    """
    if not sensing_of(vehicle):
        return log
    samples = np.column_stack([log.rotor_speeds, log.position, log.quaternion])
    models = loaded_model(vehicle)[0].copy()
    _core.undo_sensing(models.ctypes.data, log.t, log.valid, samples)
    raise_errors()
    delay = delay_of(vehicle)
    valid = log.valid & _settled(log, delay)
    samples[~valid, 4:] = np.nan
    return replace(
        log,
        rotor_speeds=samples[:, :4].copy(),
        position=samples[:, 4:7].copy(),
        quaternion=samples[:, 7:].copy(),
        voltage=voltage_at(log, log.t - delay),
        valid=valid,
    )


def _settled(log: FlightLog, delay: float) -> np.ndarray:
    """Return the rows (n,) without a break in the last ``delay`` s: their delayed signals are no
    longer made up.
    """
    seen = np.flatnonzero(log.valid)
    broken = np.diff(log.t[seen], prepend=-np.inf) > LONGEST_GAP
    # the one behind the last also stands before the first
    starts = np.append(log.t[seen[broken]], np.inf)
    began = starts[np.searchsorted(starts, log.t, side="right") - 1]
    return np.asarray(log.t >= began + delay - 1e-9)
