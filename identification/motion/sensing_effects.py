"""A log as it would be without the sensing effects that its vehicle declares: poses and rotor
speeds brought back to truth.

Everything in this folder that compares a log's motion with a model takes the corrected log; only
the filter, which undoes these effects by itself, takes the log as it is.
"""

from dataclasses import replace

import numpy as np

from ...dynamics.effects import Role, get
from ...dynamics.model import MODEL_FIELDS, load_model, rewrite_sample
from ...dynamics.vehicle import Array, EffectSetting, Vehicle
from ...runtime.compiled import Record, compiled
from ..logs.flight_log import FlightLog
from .signals import LONGEST_GAP

_MODEL = np.dtype(MODEL_FIELDS)


@compiled
def _undo(models: Record, t: Array, seen: np.ndarray, samples: Array) -> None:
    """Bring ``samples`` (n, 11), rotor speeds and pose, back to the truth in place; ``seen`` (n,)
    says where a pose is.
    """
    f = models[0]
    f.sample[7] = 1.0
    for k in range(len(t)):
        for i in range(4):
            f.sample[i] = samples[k, i]
        if seen[k]:
            for i in range(4, 11):
                f.sample[i] = samples[k, i]
        rewrite_sample(f, t[k] - t[k - 1] if k > 0 else 0.0, 7 if seen[k] else 4, -1.0)
        for i in range(11 if seen[k] else 4):
            samples[k, i] = f.sample[i]


def sensing_of(vehicle: Vehicle) -> tuple[EffectSetting, ...]:
    """Return the effects of a vehicle that change what a log's poses are."""
    return tuple(e for e in vehicle.effects if get(e.name).kind == "sensing")


def delay_of(vehicle: Vehicle) -> float:
    """Return by how much (s) rows without a vehicle's sensing effects tell of an earlier flight."""
    late = [e for e in sensing_of(vehicle) if get(e.name).role == Role.DELAY]
    return float(sum(abs(get(e.name).vector(e.coefficients)[0]) for e in late))


def undo_log_sensing(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with the vehicle's declared sensing effects taken out of its poses and rotor
    speeds.

    It is the log itself where the vehicle declares none. With a delay of dt between the clocks the
    rows tell the flight of abs(dt) ago, as the filter's estimate does, and the first abs(dt) s
    after a break of more than 0.1 s have no pose; the voltage, which is of the row's own instant,
    is that of then, and the truth stays as it is.
    """
    if not sensing_of(vehicle):
        return log
    models = np.zeros(1, dtype=_MODEL)
    load_model(models[0], vehicle)
    samples = np.column_stack([log.rotor_speeds, log.position, log.quaternion])
    _undo(models, np.ascontiguousarray(log.t), np.ascontiguousarray(log.valid), samples)
    delay = delay_of(vehicle)
    valid = log.valid & _settled(log, delay)
    samples[~valid, 4:] = np.nan
    voltage = None if log.voltage is None else np.interp(log.t - delay, log.t, log.voltage)
    return replace(
        log,
        rotor_speeds=samples[:, :4].copy(),
        position=samples[:, 4:7].copy(),
        quaternion=samples[:, 7:].copy(),
        voltage=voltage,
        valid=valid,
    )


def _settled(log: FlightLog, delay: float) -> np.ndarray:
    """Return where (n,) the last ``delay`` s had no break, so that what was delayed by it is no
    longer made up.
    """
    seen = np.flatnonzero(log.valid)
    broken = np.diff(log.t[seen], prepend=-np.inf) > LONGEST_GAP
    starts = np.append(-np.inf, log.t[seen[broken]])
    began = starts[np.searchsorted(starts, log.t, side="right") - 1]
    settled: np.ndarray = log.t >= np.where(np.isfinite(began), began + delay - 1e-9, np.inf)
    return settled
