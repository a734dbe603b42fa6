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

# tests for structure in the residual: a candidate regressor explains some of it, a coefficient
# changes with a variable, or innovations confirm an effect that the residual hardly shows
STRUCTURE_TESTS = ("candidate regressor", "varying coefficient", "innovations")
CHANNELS = ("Fx", "Fy", "Fz", "tau_x", "tau_y", "tau_z")


@dataclass(frozen=True)
class NamedEffect:
    """An effect that the model lacked."""

    name: str  # as the effect library has it
    coefficients: Mapping[str, float]  # in ``units``
    std: Mapping[str, float]  # standard deviation of each coefficient
    units: Mapping[str, str]  # of each coefficient; "1" for a pure number
    tentative: bool  # it may stand for another effect: see ``Diagnosis.structure``
    indistinguishable_from: tuple[str, ...]  # effects that would explain these logs as well
    # e.g. share of the residual on held-out blocks that it alone explains
    evidence: Mapping[str, float]
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

    name: str  # as the effect library has it
    # share of the residual's deviance that it explains on left-out blocks; may be negative
    gain: float
    named: bool  # whether the diagnosis names it


@dataclass(frozen=True, eq=False)
class Trace:
    """The residual of one unbroken piece of a log, over time (n samples)."""

    log: str  # its name
    period: float  # s
    t: Array  # (n,) s
    before: Array  # (n, 6) N and Nm, by the declared vehicle
    after: Array  # (n, 6) N and Nm, with the named effects
    held_out: Mask  # (n,) the fit never saw it
    # (n, 6) N and Nm, of each named effect: by how much ``after`` grows where this effect alone is
    # left out
    parts: Mapping[str, Array] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} of {self.log}: {len(self.t)} samples, {self.t[0]:.3g} to "
            f"{self.t[-1]:.3g} s>"
        )


@dataclass(frozen=True, eq=False)
class Signature:
    """Residual against the variable that a named effect follows (n points), with the effect's own
    part.
    """

    effect: str  # its name
    channel: str  # one of CHANNELS
    regressor: str  # what x is, with its unit
    x: Array  # (n,) in the unit that ``regressor`` states
    residual: Array  # (n,) N or Nm, by the model with all named effects but this one
    fitted: Array  # (n,) N or Nm, by this effect

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} of {self.effect}: {self.channel} over {self.regressor}, "
            f"{len(self.x)} points>"
        )


@dataclass(frozen=True)
class Structure:
    """One sign that the residual after all named effects still has structure."""

    test: str  # what was tried, in words
    where: str  # channel and regressor, in words
    gain: float  # share of the residual's deviance that it explains on left-out blocks
    kind: str  # of the test, one of ``STRUCTURE_TESTS``


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
    log: str  # its name
    t: float  # s, of its peak
    peak: float  # N, or Nm


@dataclass(frozen=True)
class Alternative:
    """A set of effects that may be what the model lacks."""

    effects: tuple[str, ...]  # names; empty: nothing of the library
    probability: float  # that these act and no others of the library


@dataclass(frozen=True)
class Probabilities:
    """How probable the names are, by search and likelihood of the logs' poses together."""

    # that it acts, of each effect that is named, or that an alternative has
    names: Mapping[str, float]
    alternatives: tuple[Alternative, ...]  # the likeliest sets of effects first
    unknown: float  # that something acts which no effect of the library is


@dataclass(frozen=True)
class RankedSet:
    """A set of effects, by the posterior alone."""

    effects: tuple[str, ...]  # names, in order of the alphabet
    probability: float  # that these act and no others, if nothing acts but effects of the library
    # of each effect, at the mode, in the units of the library
    coefficients: Mapping[str, Mapping[str, float]]
    std: Mapping[str, Mapping[str, float]]  # their standard deviations, where they have one


@dataclass(frozen=True)
class Ranking:
    """The posterior of a flight, given that nothing acts but effects of the library."""

    probability: Mapping[str, float]  # of each effect of the library, that it acts
    sets: tuple[RankedSet, ...]  # the likeliest first
    # logarithm of the Bayes factor of one more column, of a dictionary of what an effect outside
    # the library may follow, beside the likeliest set
    structure: float
    tempering: float  # power of the likelihood, 1 where its scatter is what it should be

    def likeliest_with(self, effect: str) -> RankedSet | None:
        """Return the likeliest set that has an effect; None where no set has it."""
        return next((s for s in self.sets if effect in s.effects), None)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What logs of one vehicle say about its model.

    ``remainder``, ``gusts`` and ``pushes`` are named as in ``report.json``: the kind of the
    residual, the disturbances and the transient disturbances.
    """

    verdict: str  # explained, partly explained, unexplained, nothing to explain
    remainder: str  # none, random, structured
    effects: tuple[NamedEffect, ...]  # named ones, in the order in which they were found
    held_out_segments: tuple[tuple[str, float, float], ...]  # log, from, to (s)
    before: Errors  # errors of the declared vehicle
    after: Errors  # errors of the amended vehicle
    floor_force_rms: float  # N, what sensors alone leave
    floor_torque_rms: float  # Nm
    advice: tuple[str, ...]  # what to fly to separate what these logs cannot
    # doubts about the logs, thrust models of readers, corrections that were made
    notes: tuple[str, ...]
    candidates: tuple[Candidate, ...]  # best first
    traces: tuple[Trace, ...]  # residual over time, a piece of flight each
    signatures: tuple[Signature, ...]  # one a named effect
    structure: tuple[Structure, ...]  # strongest first
    # of each channel; none where rotor speeds are worked out from commands
    gusts: tuple[Disturbance, ...]
    # one a channel at most, the plainest first; none where rotor speeds are worked out from
    # commands
    pushes: tuple[TransientDisturbance, ...]
    cutoff_hz: float  # Hz, of the low-pass of everything that was compared
    declared: Vehicle  # the vehicle that was given
    amended: Vehicle  # with the named effects, ready for ``estimate`` and the environment
    logs: tuple[str, ...]  # names of those it learned from
    test_logs: tuple[str, ...]  # those the error is on, if they were given apart
    seconds: float  # of flight in all
    # whether the logs' noise was filtered before they were written (or is not white for another
    # reason): then the floor is a lower bound
    floor_is_bound: bool = False
    # one a log that can show it: whether a rotor lost thrust during the flight, as plain data
    # (``comparison/words.py``); empty where that was not looked for
    rotor_faults: tuple[Mapping[str, Any], ...] = ()
    # effects that these logs cannot show because the pose is missing, or too slow, beside the IMU
    needs_pose: tuple[str, ...] = ()
    # why names are tentative, by the check that says so: sentences, which are notes as well, or
    # names. Beside these, ``structure`` is a doubt of all names
    doubts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    # the posterior of sets of effects; none where it was not asked for, or where rotors or pose
    # were not measured as they were
    ranking: Ranking | None = None
    # of what was found, by search and posterior together, or by the search alone where there is no
    # posterior; none where they were not asked for, or where rotor speeds are worked out from
    # commands
    probabilities: Probabilities | None = None

    def __repr__(self) -> str:
        names = ", ".join(e.name + (" (tentative)" if e.tentative else "") for e in self.effects)
        return (
            f"<{type(self).__name__} {self.verdict}: {names or 'no effect'}; force error "
            f"{self.before.force_rms:.3g} -> {self.after.force_rms:.3g} N, torque error "
            f"{self.before.torque_rms:.3g} -> {self.after.torque_rms:.3g} Nm>"
        )
