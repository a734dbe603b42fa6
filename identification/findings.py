"""What a diagnosis finds, as plain data: ``diagnosis.py`` fills it, ``report.py`` writes it down.

Everything that was compared was low-passed at ``Diagnosis.cutoff_hz`` with zero phase. Force is in
the world frame, torque about the centre of mass in the body frame.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dynamics.vehicle import Vehicle

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CHANNELS = ("Fx", "Fy", "Fz", "tau_x", "tau_y", "tau_z")


@dataclass(frozen=True)
class NamedEffect:
    """An effect that the model lacked."""

    name: str
    coefficients: Mapping[str, float]
    std: Mapping[str, float]  # standard deviation of each coefficient
    units: Mapping[str, str]
    tentative: bool  # it may stand for another effect: see ``Diagnosis.structure``
    indistinguishable_from: tuple[str, ...]  # effects that would explain these logs as well
    evidence: Mapping[
        str, float
    ]  # e.g. share of the residual on held-out blocks that it alone explains
    channels: tuple[str, ...] = ()  # of the logs, that carried the finding


@dataclass(frozen=True)
class Errors:
    """How wrong a model is on the held-out blocks; NaN where it could not be worked out."""

    force_rms: float  # N, all three axes
    torque_rms: float  # Nm
    nis_without_wrench_state: float  # mean, 6 in a perfect filter
    rollout_1s_position_rms: float  # m


@dataclass(frozen=True)
class Candidate:
    """An effect that was tried first, alone, against the bare model."""

    name: str
    # share of the residual's deviance that it explains on left-out blocks; may be negative
    gain: float
    named: bool


@dataclass(frozen=True, eq=False)
class Trace:
    """The residual of one unbroken piece of a log, over time (n samples)."""

    log: str
    period: float  # s
    t: Array  # (n,) s
    before: Array  # (n, 6) N and Nm, by the declared vehicle
    after: Array  # (n, 6) with the named effects
    held_out: Mask  # (n,) the fit never saw it
    # (n, 6) of each named effect: by how much ``after`` grows where this effect alone is left out
    parts: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Signature:
    """Residual against the variable that a named effect follows (n points), with the effect's own
    part.
    """

    effect: str
    channel: str  # one of CHANNELS
    regressor: str  # what x is, with its unit
    x: Array  # (n,)
    residual: Array  # (n,) by the model with all named effects but this one
    fitted: Array  # (n,) by this effect


@dataclass(frozen=True)
class Structure:
    """One sign that the residual after all named effects still has structure."""

    test: str  # what was tried, in words
    where: str  # channel and regressor, in words
    gain: float  # share of the residual's deviance that it explains on left-out blocks


@dataclass(frozen=True)
class Disturbance:
    """The disturbance of one channel: an Ornstein-Uhlenbeck process of maximum likelihood."""

    channel: str  # one of CHANNELS
    rms: float  # N, or Nm
    time: float  # s, correlation time

    def below(self, frequency: float) -> float:
        """Return the RMS (N, or Nm) of what is slower than a frequency (Hz)."""
        return self.rms * math.sqrt(
            2.0 / math.pi * math.atan(2.0 * math.pi * frequency * self.time)
        )


@dataclass(frozen=True)
class TransientDisturbance:
    """The largest transient disturbance of one channel."""

    channel: str  # one of CHANNELS
    log: str
    t: float  # s, of its peak
    peak: float  # N, or Nm


Gusts, Push = Disturbance, TransientDisturbance  # their older names


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What logs of one vehicle say about its model.

    ``remainder``, ``gusts`` and ``pushes`` are named as in ``report.json``: the kind of the
    residual, the disturbances and the transient disturbances.
    """

    verdict: str  # explained, partly explained, unexplained, nothing to explain
    remainder: str  # none, random, structured
    effects: tuple[NamedEffect, ...]
    held_out_segments: tuple[tuple[str, float, float], ...]  # log, from, to (s)
    before: Errors
    after: Errors
    floor_force_rms: float  # N, what sensors alone leave
    floor_torque_rms: float  # Nm
    advice: tuple[str, ...]  # what to fly to separate what these logs cannot
    notes: tuple[
        str, ...
    ]  # doubts about the logs, thrust models of readers, corrections that were made
    candidates: tuple[Candidate, ...]  # best first
    traces: tuple[Trace, ...]
    signatures: tuple[Signature, ...]
    structure: tuple[Structure, ...]  # strongest first
    gusts: tuple[
        Disturbance, ...
    ]  # of each channel; none where rotor speeds are worked out from commands
    pushes: tuple[
        TransientDisturbance, ...
        # one a channel at most, the plainest first; none where rotor speeds are worked out from
        # commands
    ]
    cutoff_hz: float
    declared: Vehicle
    amended: Vehicle  # with the named effects, ready for ``estimate`` and the environment
    logs: tuple[str, ...]
    test_logs: tuple[str, ...]  # those the error is on, if they were given apart
    seconds: float  # of flight in all
    # whether the logs' noise was filtered before they were written (or is not white for another
    # reason): then the floor is a lower bound
    floor_is_bound: bool = False
    # one a log that can show it: whether a rotor lost thrust during the flight, as plain data
    # (``rotor_faults/words.py``); empty where that was not looked for
    rotor_faults: tuple[Mapping[str, Any], ...] = ()
    # effects that these logs cannot show because the pose is missing, or too slow, beside the IMU
    needs_pose: tuple[str, ...] = ()
