"""Poses and rotor speeds as measured, for the causal filter of a flight."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from ...dynamics.vehicle import Vehicle
from ..logs.table import Array, Mask, Rows
from ..motion.sensing_effects import sensing_of, undo_log_sensing
from ..motion.signals import log_signals
from ..motion.smoothing import continuous
from .coefficients import is_delay
from .log_offsets import ROTOR_TIME_OFFSET, with_time_offsets
from .noise_search import SETTLING_TIME
from .regression import RegressedFlights


@dataclass(frozen=True, eq=False)
class Poses:
    """Unbroken pieces of flights as measured, one after the other, evenly spaced (n samples)."""

    period: float  # s
    t: Array  # (n,) s
    position: Array  # (n, 3) m
    quaternion: Array  # (n, 4), of continuous sign
    rotor_speeds: Array  # (n, 4) rad/s, at the samples
    voltage: Array  # (n,) V; 0 where unknown
    start: Array  # (p, 6) m/s, and rad/s, body: the velocities at the start of each piece
    sample: Rows  # (n,) number of the sample in its piece
    log: Rows  # (n,) index of its log among the flights
    counted: Mask  # (n,) whether in the fit

    @classmethod
    def read(cls, flights: RegressedFlights, vehicle: Vehicle, finer: Sequence[Array]) -> "Poses":
        """Return the unbroken pieces of the flights in the fit as measured. A vehicle's sensing
        effects are undone, and ``finer`` (n, 4) is added to the rotor speeds of each piece.

        For late or early poses, rotor speeds are moved instead: moved poses would lose noise.
        """
        late = [e for e in sensing_of(vehicle) if is_delay(e.name)]
        offset = sum(x for e in late for x in e.coefficients.values())
        on_time = replace(vehicle, effects=tuple(e for e in vehicle.effects if e not in late))
        each = iter(finer)
        out = []
        for at in np.unique(flights.log[flights.fit_rows]).tolist():
            rows = np.flatnonzero(flights.log == at)
            undone = undo_log_sensing(flights.logs[at], on_time)
            for raw, smooth in zip(log_signals(undone, np.inf), log_signals(undone), strict=True):
                raw = replace(raw, rotor_speeds=raw.rotor_speeds + next(each, 0.0))
                raw = with_time_offsets(raw, {ROTOR_TIME_OFFSET.coefficient: offset})
                q = Rotation.from_matrix(raw.rotation).as_quat(scalar_first=True)
                n = len(raw.t)
                near = np.searchsorted(flights.t[rows], raw.t).clip(max=len(rows) - 1)
                counted = flights.fit_rows[rows[near]]
                counted[: round(SETTLING_TIME / raw.period)] = False
                out.append(
                    (
                        raw.t,
                        raw.position,
                        continuous(q),
                        raw.rotor_speeds,
                        np.zeros(n) if raw.voltage is None else raw.voltage,
                        np.hstack([smooth.velocity[:1], smooth.angular_velocity[:1]]),
                        np.arange(n),
                        np.full(n, at),
                        counted,
                    )
                )
        return cls(raw.period, *map(np.concatenate, zip(*out, strict=True)))

    @property
    def begins(self) -> Rows:
        """First row of each piece (p,)."""
        return np.flatnonzero(self.sample == 0)

    @property
    def pieces(self) -> list[slice]:
        """The samples of each piece."""
        return [slice(*ends) for ends in pairwise([*self.begins, len(self.t)])]
