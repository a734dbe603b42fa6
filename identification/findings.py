"""The findings of a diagnosis, as plain data: ``diagnosis`` fills it, ``report`` writes it down.

All compared quantities were low-passed at ``Diagnosis.cutoff_hz`` with zero phase. Force is in the
world frame, torque about the centre of mass in the body frame.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..dynamics.vehicle import Vehicle
from .logs.table import Array, ArrayMap, Mask, NamedNumbers, Names, Pair, Values

# share of the likeliest set's probability from which flights do not tell another set from this one:
# a likelihood of 20 to 1
LEAST_RIVAL = 0.05
CHANNELS = ("Fx", "Fy", "Fz", "tau_x", "tau_y", "tau_z")


@dataclass(frozen=True)
class NamedEffect:
    """An effect missing in the model.

    Attributes:
        name: its name in the effect library.
        coefficients: in ``units``.
        std: standard deviation of each coefficient.
        units: of each coefficient; "1" for a pure number.
        tentative: whether it may stand for another effect: see ``Diagnosis.structure``.
        indistinguishable_from: effects with an equal explanation of these logs.
        evidence: its share of the held-out residual's energy; the logarithm of the Bayes factor of
            sets with it against sets without; its largest coefficient in typical sizes; its size
            over the unexplained rest; and its gain in log-likelihood on flight left out of the fit.
        channels: channels of the logs with the finding.
    """

    name: str
    coefficients: Values
    std: Values
    units: Mapping[str, str]
    tentative: bool
    indistinguishable_from: Names
    evidence: Values
    channels: Names = ()


@dataclass(frozen=True)
class Errors:
    """Errors of a model on the held-out blocks; NaN if not computable.

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
    """An effect tried alone, against the bare model.

    Attributes:
        name: its name in the effect library.
        gain: its deviance, over the deviance of the whole library.
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
        held_out: (n,) whether it is outside the fit.
        parts: (n, 6) N and Nm, of each named effect: growth of ``after`` with this effect alone
            left out.
    """

    log: str
    period: float
    t: Array = field(repr=False)
    before: Array = field(repr=False)
    after: Array = field(repr=False)
    held_out: Mask = field(repr=False)
    parts: ArrayMap = field(repr=False)


@dataclass(frozen=True, eq=False)
class Signature:
    """Residual against the variable followed by a named effect (n points), with the effect's own
    part.

    Attributes:
        effect: its name.
        channel: one of CHANNELS.
        regressor: name of x, with its unit.
        x: (n,) in the unit of ``regressor``.
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
    """The dictionary's best column beside the named effects.

    Attributes:
        test: its group, in words.
        where: channel and variable, in words.
        gain: share of the remaining deviance.
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
        unanswered: N, or Nm, part not answered by the rotors before the pose shows it.
    """

    channel: str
    rms: float
    time: float
    unanswered: float = 0.0

    def unanswered_below(self, frequency: float) -> float:
        """Return the RMS (N, or Nm) of the unanswered part below a frequency (Hz)."""
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
    """A set of effects possibly missing in the model.

    Attributes:
        effects: names; empty: nothing of the library.
        probability: of these effects and no others of the library.
    """

    effects: Names
    probability: float


@dataclass(frozen=True)
class Probabilities:
    """Probabilities of the findings.

    Attributes:
        names: probability of each effect that is named or in an alternative.
        alternatives: the likeliest sets of effects first.
        unknown: probability of a cause outside the library.
    """

    names: Values
    alternatives: tuple[Alternative, ...]
    unknown: float


_UNKNOWN = Probabilities({}, (), math.nan)


@dataclass(frozen=True)
class RankedSet:
    """A set of effects.

    Attributes:
        effects: names, in order of the alphabet.
        probability: of these effects and no others, without a cause outside the library.
        coefficients: of each effect, at the mode, in the units of the library.
        std: their standard deviations, if they have one.
    """

    effects: Names
    probability: float
    coefficients: Mapping[str, Values]
    std: Mapping[str, Values]


@dataclass(frozen=True)
class Ranking:
    """The posterior of a flight, without a cause outside the library.

    Attributes:
        probability: of each effect of the library.
        sets: the likeliest first.
        structure: logarithm of the Bayes factor of one more column beside the likeliest set. The
            columns are of a dictionary of variables for effects outside the library.
        tempering: power of the likelihood, 1 if its scatter is as expected.
    """

    probability: Values
    sets: tuple[RankedSet, ...]
    structure: float
    tempering: float

    def averaged(self, effect: str) -> tuple[NamedNumbers, NamedNumbers]:
        """Return the coefficients of an effect of the likeliest set, and their standard deviations,
        averaged over the likely sets with it.

        Each set leaves another share to the effect, also by effects without need of a name. (Model
        averaging in Occam's window: J. A. Hoeting and others, Statistical Science 14 (1999),
        382-417.)
        """
        best = self.sets[0]
        values, std = dict(best.coefficients[effect]), dict(best.std[effect])
        likely = [x for x in self.sets if x.probability >= LEAST_RIVAL * best.probability]
        for name in std:
            value, own, weight = np.transpose(
                [
                    (x.coefficients[effect][name], x.std[effect][name], x.probability)
                    for x in likely
                    if name in x.std.get(effect, ())
                ]
            )
            weight /= weight.sum()
            values[name] = float(weight @ value)
            std[name] = math.sqrt(weight @ (own**2 + (value - values[name]) ** 2))
        return values, std


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The findings of one vehicle's logs about its model.

    ``remainder``, ``gusts`` and ``pushes`` are named as in ``report.json``: the kind of the
    residual, the disturbances and the transient disturbances.

    Attributes:
        verdict: explained, partly explained, unexplained, nothing to explain.
        remainder: none, random, structured.
        effects: named ones, in the order of their finding.
        held_out_segments: log, from, to (s)
        before: errors of the declared vehicle.
        after: errors of the amended vehicle.
        floor_force_rms: N, of the sensors' noise alone.
        floor_torque_rms: Nm.
        advice: flights for the questions these logs leave open.
        notes: doubts about the logs, thrust models of readers, corrections made.
        candidates: best first.
        traces: residual over time, a piece of flight each.
        signatures: one a named effect.
        structure: strongest first.
        gusts: of each channel; none unless pose and rotor speeds are as measured.
        pushes: one a channel at most, the plainest first.
        cutoff_hz: Hz, of the low-pass of all compared quantities.
        declared: the given vehicle.
        amended: with the named effects, ready for ``estimate`` and the environment.
        logs: names of the fitted logs.
        test_logs: names of the logs for the error, if given apart.
        seconds: s of flight in all.
        floor_is_bound: whether the logs' noise was filtered before they were written (or is not
            white for another reason): then the floor is a lower bound.
        rotor_faults: one a log with enough data: whether a rotor lost thrust during the flight, as
            plain data (``comparison/words.py``); empty without a search.
        needs_pose: effects hidden in these logs because the pose is missing, or too slow, beside
            the IMU.
        doubts: reasons for tentative names, by check: sentences (notes as well), or names. Beside
            these, ``structure`` is a doubt of all names.
        ranking: the posterior of sets of effects.
        probabilities: of the findings.
        not_needed: effects of the likeliest set without help on flight left out of their fit.
    """

    verdict: str
    remainder: str
    effects: tuple[NamedEffect, ...]
    held_out_segments: tuple[tuple[str, float, float], ...]
    before: Errors
    after: Errors
    floor_force_rms: float
    floor_torque_rms: float
    advice: Names
    notes: Names
    candidates: tuple[Candidate, ...]
    traces: tuple[Trace, ...]
    signatures: tuple[Signature, ...]
    structure: tuple[Structure, ...]
    gusts: tuple[Disturbance, ...]
    pushes: tuple[TransientDisturbance, ...]
    cutoff_hz: float
    declared: Vehicle
    amended: Vehicle
    logs: Names
    test_logs: Names
    seconds: float
    floor_is_bound: bool = False
    rotor_faults: tuple[Mapping[str, Any], ...] = ()
    needs_pose: Names = ()
    doubts: Mapping[str, Names] = field(default_factory=dict)
    ranking: Ranking | None = None
    probabilities: Probabilities = _UNKNOWN
    not_needed: tuple[NamedEffect, ...] = ()

    @property
    def held_out_by_log(self) -> dict[str, list[Pair]]:
        """The held-out segments, from and to (s), of each log with some."""
        blocks: dict[str, list[Pair]] = {}
        for log, start, end in self.held_out_segments:
            blocks.setdefault(log, []).append((start, end))
        return blocks

    def __repr__(self) -> str:
        names = ", ".join(e.name + " (tentative)" * e.tentative for e in self.effects)
        return (
            f"<{type(self).__name__} {self.verdict}: {names or 'no effect'}; force error "
            f"{self.before.force_rms:.3g} -> {self.after.force_rms:.3g} N, torque error "
            f"{self.before.torque_rms:.3g} -> {self.after.torque_rms:.3g} Nm>"
        )
