"""What a diagnosis finds, as plain data: ``diagnosis`` fills it, ``report`` writes it down.

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
    """An effect that the model lacked.

    Attributes:
        name: as the effect library has it.
        coefficients: in ``units``.
        std: standard deviation of each coefficient.
        units: of each coefficient; "1" for a pure number.
        tentative: it may stand for another effect: see ``Diagnosis.structure``.
        indistinguishable_from: effects that would explain these logs as well.
        evidence: the share of the held-out residual's energy that it explains; the logarithm of
            the Bayes factor of sets with it against those without; its largest coefficient in
            typical sizes; and its size over what is left unexplained.
        channels: of the logs, that carried the finding.
    """

    name: str
    coefficients: Mapping[str, float]
    std: Mapping[str, float]
    units: Mapping[str, str]
    tentative: bool
    indistinguishable_from: tuple[str, ...]
    evidence: Mapping[str, float]
    channels: tuple[str, ...] = ()


@dataclass(frozen=True)
class Errors:
    """How wrong a model is on the held-out blocks; NaN where it could not be worked out.

    Attributes:
        force_rms: N, all three axes.
        torque_rms: Nm.
        nis_without_wrench_state: mean, 6 in a perfect filter.
        rollout_1s_position_rms: m.
    """

    force_rms: float
    torque_rms: float
    nis_without_wrench_state: float
    rollout_1s_position_rms: float


@dataclass(frozen=True)
class Candidate:
    """An effect that was tried alone, against the bare model.

    Attributes:
        name: as the effect library has it.
        gain: deviance that it explains, over that which the whole library explains.
        named: whether the diagnosis names it.
    """

    name: str
    gain: float
    named: bool


@dataclass(frozen=True, eq=False)
class Trace:
    """The residual of one unbroken piece of a log, over time (n samples).

    Attributes:
        log: its name.
        period: s.
        t: (n,) s.
        before: (n, 6) N and Nm, by the declared vehicle.
        after: (n, 6) N and Nm, with the named effects.
        held_out: (n,) the fit never saw it.
        parts: (n, 6) N and Nm, of each named effect: by how much ``after`` grows where this
            effect alone is left out.
    """

    log: str
    period: float
    t: Array = field(repr=False)
    before: Array = field(repr=False)
    after: Array = field(repr=False)
    held_out: Mask = field(repr=False)
    parts: Mapping[str, Array] = field(default_factory=dict, repr=False)


@dataclass(frozen=True, eq=False)
class Signature:
    """Residual against the variable that a named effect follows (n points), with the effect's own
    part.

    Attributes:
        effect: its name.
        channel: one of CHANNELS.
        regressor: what x is, with its unit.
        x: (n,) in the unit that ``regressor`` states.
        residual: (n,) N or Nm, by the model with all named effects but this one.
        fitted: (n,) N or Nm, by this effect.
    """

    effect: str
    channel: str
    regressor: str
    x: Array = field(repr=False)
    residual: Array = field(repr=False)
    fitted: Array = field(repr=False)


@dataclass(frozen=True)
class Structure:
    """The column of a dictionary that explains most of what the named effects leave.

    Attributes:
        test: its group, in words.
        where: channel and variable, in words.
        gain: share of the deviance that is left, which it explains.
    """

    test: str
    where: str
    gain: float


@dataclass(frozen=True)
class Disturbance:
    """The disturbance of one channel: an Ornstein-Uhlenbeck process of maximum likelihood.

    Attributes:
        channel: one of CHANNELS; of a raw pose roll and pitch are about the world's x and y.
        rms: N, or Nm.
        time: s, correlation time.
        unanswered: N, or Nm, what of it the rotors do not answer before the pose shows it.
    """

    channel: str
    rms: float
    time: float
    unanswered: float = 0.0

    def unanswered_below(self, frequency: float) -> float:
        """Return the RMS (N, or Nm) of what is unanswered and slower than a frequency (Hz)."""
        return self.unanswered * math.sqrt(
            2.0 / math.pi * math.atan(2.0 * math.pi * frequency * self.time)
        )


@dataclass(frozen=True)
class TransientDisturbance:
    """The largest transient disturbance of one channel.

    Attributes:
        channel: one of CHANNELS.
        log: its name.
        t: s, of its peak.
        peak: N, or Nm.
    """

    channel: str
    log: str
    t: float
    peak: float


@dataclass(frozen=True)
class Alternative:
    """A set of effects that may be what the model lacks.

    Attributes:
        effects: names; empty: nothing of the library.
        probability: that these act and no others of the library.
    """

    effects: tuple[str, ...]
    probability: float


@dataclass(frozen=True)
class Probabilities:
    """How probable what was found is.

    Attributes:
        names: that it acts, of each effect that is named, or that an alternative has.
        alternatives: the likeliest sets of effects first.
        unknown: that something acts which no effect of the library is.
    """

    names: Mapping[str, float]
    alternatives: tuple[Alternative, ...]
    unknown: float


@dataclass(frozen=True)
class RankedSet:
    """A set of effects.

    Attributes:
        effects: names, in order of the alphabet.
        probability: that these act and no others, if nothing acts but effects of the library.
        coefficients: of each effect, at the mode, in the units of the library.
        std: their standard deviations, where they have one.
    """

    effects: tuple[str, ...]
    probability: float
    coefficients: Mapping[str, Mapping[str, float]]
    std: Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Ranking:
    """The posterior of a flight, given that nothing acts but effects of the library.

    Attributes:
        probability: of each effect of the library, that it acts.
        sets: the likeliest first.
        structure: logarithm of the Bayes factor of one more column, of a dictionary of what an
            effect outside the library may follow, beside the likeliest set.
        tempering: power of the likelihood, 1 where its scatter is what it should be.
    """

    probability: Mapping[str, float]
    sets: tuple[RankedSet, ...]
    structure: float
    tempering: float


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What logs of one vehicle say about its model.

    ``remainder``, ``gusts`` and ``pushes`` are named as in ``report.json``: the kind of the
    residual, the disturbances and the transient disturbances.

    Attributes:
        verdict: explained, partly explained, unexplained, nothing to explain.
        remainder: none, random, structured.
        effects: named ones, in the order in which they were found.
        held_out_segments: log, from, to (s)
        before: errors of the declared vehicle.
        after: errors of the amended vehicle.
        floor_force_rms: N, what sensors alone leave.
        floor_torque_rms: Nm.
        advice: what to fly to separate what these logs cannot.
        notes: doubts about the logs, thrust models of readers, corrections that were made.
        candidates: best first.
        traces: residual over time, a piece of flight each.
        signatures: one a named effect.
        structure: strongest first.
        gusts: of each channel; none where pose or rotor speeds are not as they were measured.
        pushes: one a channel at most, the plainest first.
        cutoff_hz: Hz, of the low-pass of everything that was compared.
        declared: the vehicle that was given.
        amended: with the named effects, ready for ``estimate`` and the environment; the declared
            vehicle where they do not make the held-out error smaller.
        logs: names of those it learned from.
        test_logs: those the error is on, if they were given apart.
        seconds: of flight in all.
        floor_is_bound: whether the logs' noise was filtered before they were written (or is not
            white for another reason): then the floor is a lower bound.
        rotor_faults: one a log that can show it: whether a rotor lost thrust during the flight, as
            plain data (``comparison/words.py``); empty where that was not looked for.
        needs_pose: effects that these logs cannot show because the pose is missing, or too slow,
            beside the IMU.
        doubts: why names are tentative, by the check that says so: sentences, which are notes as
            well, or names. Beside these, ``structure`` is a doubt of all names.
        ranking: the posterior of sets of effects.
        probabilities: of what was found.
    """

    verdict: str
    remainder: str
    effects: tuple[NamedEffect, ...]
    held_out_segments: tuple[tuple[str, float, float], ...]
    before: Errors
    after: Errors
    floor_force_rms: float
    floor_torque_rms: float
    advice: tuple[str, ...]
    notes: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    traces: tuple[Trace, ...]
    signatures: tuple[Signature, ...]
    structure: tuple[Structure, ...]
    gusts: tuple[Disturbance, ...]
    pushes: tuple[TransientDisturbance, ...]
    cutoff_hz: float
    declared: Vehicle
    amended: Vehicle
    logs: tuple[str, ...]
    test_logs: tuple[str, ...]
    seconds: float
    floor_is_bound: bool = False
    rotor_faults: tuple[Mapping[str, Any], ...] = ()
    needs_pose: tuple[str, ...] = ()
    doubts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    ranking: Ranking | None = None
    probabilities: Probabilities = field(default_factory=lambda: Probabilities({}, (), math.nan))

    @property
    def held_out_by_log(self) -> dict[str, list[tuple[float, float]]]:
        """The held-out segments, from and to (s), of each log that has some."""
        blocks: dict[str, list[tuple[float, float]]] = {}
        for log, start, end in self.held_out_segments:
            blocks.setdefault(log, []).append((start, end))
        return blocks

    def __repr__(self) -> str:
        names = ", ".join(e.name + (" (tentative)" if e.tentative else "") for e in self.effects)
        return (
            f"<{type(self).__name__} {self.verdict}: {names or 'no effect'}; force error "
            f"{self.before.force_rms:.3g} -> {self.after.force_rms:.3g} N, torque error "
            f"{self.before.torque_rms:.3g} -> {self.after.torque_rms:.3g} Nm>"
        )
