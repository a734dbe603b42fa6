"""From flight logs to the effects missing in their vehicle's model: the whole of a diagnosis.

Effects and coefficients are chosen on the fitted blocks of flight. The errors before and after are
of blocks, or logs, outside the fit. A name is sure under three conditions: it is probable; its
effect is at least as large as the unexplained residual beyond the sensors' noise; and little speaks
for a cause outside the library. The rule is the same for every kind of log. The likelihood differs:
of the poses, where poses and rotors were logged as measured, or of the wrench's balance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...dynamics.effects import Role, get, names, playing
from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError, unknown_name
from ...runtime.threads import one_thread
from ..findings import (
    CHANNELS,
    LEAST_RIVAL,
    Alternative,
    Candidate,
    Diagnosis,
    Errors,
    NamedEffect,
    Probabilities,
    Structure,
    Trace,
)
from ..logs.flight_log import Logs
from ..logs.screening import LEAST_SECONDS, screen_log
from ..logs.table import Array, NamedNumbers, Names, Pair, Values
from ..motion.noise_spectrum import filtering_notes, pose_was_filtered
from ..motion.pose_clock import on_pose_clock
from ..motion.smoothing import CUTOFFS, mean_square
from ..prediction import nis_without_wrench_state, rollout_error
from ..wrench_series import pose_notes
from .advice import FILTERED, advice, composites, inertial_notes, late_rotors, outside_the_fit
from .commanded_rotors import THRUST_FACTORS
from .commands import what_commands_show
from .log_offsets import delays_at_bound
from .priors import NUISANCE, declared
from .ranking import Report, rank, rank_by_rows
from .regression import (
    CENTRAL,
    RegressedFlights,
    coefficient,
    typical_size,
    unit_of_change,
    without,
)
from .residuals import balance, is_beyond_calm, transient_disturbances
from .row_nuisances import between_flights
from .settings import DIAGNOSIS, DiagnosisSettings
from .traces import carrying_channels, signature
from .unknown import beside_unknown, unknown
from .worth import BY_CHANCE, worth

LEAST_STATED = 0.001  # probability of a reported alternative
LEAST_SIZE = 0.1  # typical sizes, from which a calibration is worth a name
# deviance of a typical size, from which an effect would be sure: for one of some thirty effects,
# with one expected before, 20 to 1 afterwards
LEAST_SHOWN = 13.0


@one_thread()
def diagnose(
    logs: Logs,
    vehicle: Vehicle,
    test: Logs = (),
    without: Sequence[str] = (),
    report: Report = lambda text: None,
    settings: DiagnosisSettings = DIAGNOSIS,
) -> Diagnosis:
    """Return the findings of one vehicle's logs about its model.

    Args:
        logs: flights to learn from.
        vehicle: as declared. Coefficients missing in a declared effect are fitted.
        test: flights for the error alone; default: 3 s of each 12 s of ``logs``, left out of the
            fit.
        without: effects taken out of the library.
        report: called with a line of progress.
        settings: which logs are taken, and when a name is sure.

    Raises:
        InputError: a log contradicts its declaration, or an effect is unknown.
    """
    for name in without:
        if name not in names():
            raise unknown_name("effect", name, names(), "--without")
    if not logs:
        raise InputError("diagnose: no log was given; expected at least one")
    report("looking at the logs")
    logs, test = ([on_pose_clock(log) for log in some] for some in (logs, test))
    every = (*logs, *test)
    least = (
        LEAST_SECONDS if len(every) == 1 and not every[0].commanded else settings.least_seconds_each
    )
    checked = [screen_log(log, vehicle, least) for log in every]
    flights = RegressedFlights(logs, vehicle, test)
    noted = [
        *((log, log.notes) for log in flights.logs),
        *checked,
        *((log, filtering_notes(log)) for log in every),
        *((log, pose_notes(log, vehicle)) for log, _ in checked),
    ]
    notes = [f"{log.name}: {note}" for log, own in noted for note in own]
    said = _Judged(flights, [n for n in names() if n not in without], settings, report)
    effects = said.effects
    residuals = said.balance
    sure = said.remainder == "none" and not any(
        effect.tentative or effect.indistinguishable_from for effect in effects
    )
    if effects:
        verdict = "explained" if sure else "partly explained"
    else:
        verdict = "nothing to explain" if sure else "unexplained"
    report("predicting the flights")
    named = {e: x for e, x in said.setting.items() if e}
    amended = flights.amended(named) if named else vehicle
    notes += [*said.notes, *outside_the_fit(flights)]
    segments = _segments(flights)
    predicted = {model: _predicted(flights, model, segments) for model in {vehicle, amended}}
    hidden = flights.needs_pose | said.hidden
    unseen = (flights.not_identifiable | said.unseen) - flights.needs_pose
    return Diagnosis(
        verdict=verdict,
        remainder=said.remainder,
        effects=effects,
        not_needed=said.not_needed,
        held_out_segments=tuple((flights.logs[i].name, a, b) for i, a, b in segments),
        before=Errors(*residuals.error_before, *predicted[vehicle]),
        after=Errors(*residuals.error_after, *predicted[amended]),
        floor_force_rms=residuals.floor[0],
        floor_torque_rms=residuals.floor[1],
        advice=tuple(
            advice(effects, sorted(unseen), said.remainder, flights.filtered, sorted(hidden))
        ),
        notes=tuple(dict.fromkeys(notes)),
        candidates=said.candidates,
        traces=tuple(said.traces()),
        signatures=tuple(
            signature(flights, said.setting, e.name, said.parts[e.name], residuals.after)
            for e in effects
        ),
        structure=said.structure,
        gusts=said.fitted.gusts,
        pushes=said.pushes,
        cutoff_hz=CUTOFFS.residual_hz,
        declared=vehicle,
        amended=amended,
        logs=tuple(log.name for log in logs),
        test_logs=tuple(log.name for log in test),
        seconds=float(sum(log.t[-1] - log.t[0] for log in every)),
        floor_is_bound=not flights.inertial
        and (flights.filtered or any(map(pose_was_filtered, every))),
        needs_pose=tuple(sorted(hidden)),
        doubts=said.doubts,
        ranking=said.fitted.ranking,
        probabilities=said.probabilities,
    )


class _Judged:
    """The effects behind flights, by the evidence of sets of effects, and the residual.

    Args:
        flights: the vehicle's flights.
        library: effects for a name.
        rule: when a name is sure.
        report: called with a line of progress.

    Public attributes are as in ``Diagnosis``, and beside them:

    Attributes:
        fitted: the posterior, and the fit of the likeliest set.
        setting: coefficients of the effects; under no name the sensors' errors.
        balance: the residual with them.
        parts: growth of the residual (rows, 6) with one effect left out.
        hidden: effects hidden by the errors of an IMU alone.
        unseen: effects whose typical size these flights would not show.
    """

    def __init__(
        self,
        flights: RegressedFlights,
        library: Sequence[str],
        rule: DiagnosisSettings,
        report: Report,
    ) -> None:
        self._flights = flights
        self._rule = rule
        library = [e for e in library if e not in flights.not_identifiable]
        given = self._given = what_commands_show(flights, library)
        report("asking how probable each effect is")
        likeliest = (
            rank(flights, library, report)
            if flights.has_raw_poses
            else rank_by_rows(flights.of_the_fit(), given.library, given.first, given.fixed, report)
        )
        self._best = likeliest.ranking.sets[0]
        self._averaged = {e: likeliest.ranking.averaged(e) for e in self._best.effects}
        sensors = {name: value for name, (value, _) in likeliest.sensors.items()}
        known_apart = {**given.fixed, **({"": sensors} if sensors else {})}
        # no set with a larger error on held-out flight is printed
        for fitted in (likeliest, replace(likeliest, setting={}, behind={})):
            self.setting = known_apart | fitted.setting
            self.balance = balance(flights, self.setting)
            if self.balance.better:
                break
        self.fitted = fitted
        self.parts = {
            e: flights.residual(without(self.setting, e)) - self.balance.after
            for e in self.setting
            if e
        }
        self.pushes = tuple(transient_disturbances(flights, self.setting))
        known = {e: self._differs(e) for e in given.first if e in self._best.effects}
        said = [e for e in self._best.effects if known.get(e, 1.0) >= rule.least_sure_probability]
        named = [e for e in fitted.setting if e in said]
        structure = fitted.ranking.structure
        strange = unknown(structure, bool(self.pushes))
        rivals = {e: self._rivals(e) for e in named}
        for e in {*named}.difference(known):  # an effect, or its rivals in these flights
            alike = [x.probability for x in fitted.ranking.sets if {e, *rivals[e]} & {*x.effects}]
            factor = fitted.posterior.factor_in_set(e)
            known[e] = beside_unknown(min(sum(alike), 1.0), factor, structure, strange)
        self.doubts = self._doubts(named, strange)
        unsure = bool(set(self.doubts) - {"assumed thrust"})
        sizes = worth(flights, given.fixed, given.first, fitted.setting)
        effects = [self._named(e, known[e], sizes[e], unsure, rivals[e]) for e in named]
        names = {e: known[e] for e in named}
        if late := given.late:
            names[late.name] = _apart(*late.coefficients.values(), *late.std.values())
            effects.append(
                replace(
                    late,
                    std=self._of_any_flight(late.name, late.coefficients, late.std),
                    tentative=unsure or names[late.name] < rule.least_sure_probability,
                )
            )
        self.effects = tuple(effects)
        self.not_needed = tuple(
            self._stated(e, *self._averaged[e]) for e in said if e not in fitted.setting
        )
        structured = strange > 0.5 and structure > 0.0
        self.structure: tuple[Structure, ...] = ()
        if structured:  # the dictionary's best column beside the likeliest set
            (_, name), _, gained = fitted.posterior.strangest()
            group, what = name.removeprefix("unknown ").split(": ", 1)
            column, _, channel = what.rpartition(" in ")
            where = f"{CHANNELS[int(channel)]} with {column}" if column else f"the part of {what}"
            self.structure = (Structure(group, where, gained / fitted.posterior.left()),)
        some = self.balance.noisy or is_beyond_calm(fitted.gusts, flights.vehicle) or self.pushes
        self.remainder = "structured" if structured else "random" if some else "none"
        by_bias = fitted.posterior.shown([("", f"{NUISANCE}{name}") for _, name in flights.biases])
        unseen = {e for e, x in fitted.posterior.shown().items() if x < LEAST_SHOWN}
        self.hidden = {e for e in unseen if by_bias[e] >= LEAST_SHOWN}
        self.unseen = unseen - self.hidden
        alone = sorted(fitted.posterior.alone().items(), key=lambda x: -x[1])
        self.candidates = tuple(Candidate(e, gain, e in named) for e, gain in alone)
        self.notes = (
            *inertial_notes(flights, named),
            *(sentence for sentences in self.doubts.values() for sentence in sentences),
            *late_rotors(flights, fitted.setting, fitted.sensors),
            *delays_at_bound(self.setting),
        )
        stated = tuple(
            Alternative(tuple(e for e in x.effects if e not in given.first), x.probability)
            for x in fitted.ranking.sets
            if x.probability >= LEAST_STATED
        )
        self.probabilities = Probabilities(names, stated, strange)

    def _std(self, effect: str) -> NamedNumbers:
        """Return the standard deviations of an effect in the likeliest set, with the spread from
        flight to flight.
        """
        return self._of_any_flight(effect, *self._averaged[effect])

    def _of_any_flight(self, effect: str, values: Values, std: Values) -> NamedNumbers:
        """Return standard deviations of coefficients with the spread from flight to flight."""
        return {
            name: math.hypot(x, between_flights((effect, name), values[name], self._flights))
            for name, x in std.items()
        }

    def _differs(self, effect: str) -> float:
        """Return the probability of a calibration, in every set, to differ from the vehicle's
        statement; 0 where the difference is too small for a name.
        """
        apart = [0.0]
        # these flights are late, however late others are
        delays = get(effect).role == Role.DELAY
        values, stds = self._averaged[effect]
        for name, std in (stds if delays else self._std(effect)).items():
            c = effect, name
            off = abs(values[name] - declared(c, self._flights))
            if off > LEAST_SIZE * typical_size(c, self._flights.vehicle) and std:
                apart.append(_apart(off, std))
        return max(apart)

    def _rivals(self, effect: str) -> Names:
        """Return the effects with nearly the likelihood of one in the likeliest set, in its
        place.
        """
        if effect in self._given.first:
            factors = playing(*THRUST_FACTORS)
            return tuple(x for x in factors if x != effect) if effect in factors else ()
        own = {*self._best.effects}
        least = LEAST_RIVAL * self._best.probability
        swapped = [
            own ^ {*x.effects}
            for x in self.fitted.ranking.sets
            if x.probability > least and len(x.effects) == len(own)
        ]
        return tuple(e for x in swapped if effect in x and len(x) == 2 for e in x - {effect})

    def _doubts(self, named: Sequence[str], strange: float) -> dict[str, Names]:
        """Return for each check, by its name, sentences with a reason to doubt a name."""
        flights = self._flights
        rule = self._rule
        unsure = ": all names are tentative" if named else ""
        doubts = {
            "composite": tuple(
                composites(flights.vehicle, {e: self._averaged[e] for e in self.fitted.setting})
            ),
            "unknown": (
                f"a cause outside the library acts with a probability of {strange:.0%}{unsure}",
            )
            * (strange > rule.most_unknown),
            "short": (
                f"{flights.seconds:.1f} s of flight are too few for a sure name: fly at least "
                f"{rule.least_seconds:g} s",
            )
            * (flights.seconds < rule.least_seconds),
            "filtered pose": (FILTERED,) * (flights.filtered and bool(named)),
            "hidden cause": tuple(
                f"{effect}: {' or '.join(hidden)}, which these logs do not show, would look like "
                "it. Log the pose to tell them apart"
                for effect, hidden in self.fitted.behind.items()
                if hidden
            ),
            "assumed thrust": tuple(
                f"{effect}: the log holds motor commands and the vehicle file states no motor "
                "curve, so how much thrust a command makes is an assumption, and this effect may "
                "be its error alone. State motor_curve in the vehicle file, or log rotor speeds"
                for effect in playing(*THRUST_FACTORS, among=named)
                if flights.thrust_std > 0.0
            ),
        }
        return {check: sentences for check, sentences in doubts.items() if sentences}

    def _named(
        self, effect: str, probability: float, size: float, unsure: bool, others: Names
    ) -> NamedEffect:
        flights = self._flights
        vehicle = flights.vehicle
        fitted = self.fitted
        std = self._std(effect)
        # the point of action of an effect at the rotors, as declared, is nothing to report
        values = {
            name: x
            for name, x in self._averaged[effect][0].items()
            if name != CENTRAL or x > BY_CHANCE * std.get(name, math.inf)
        }
        uncertain = flights.thrust_std > 0.0 and get(effect).role in THRUST_FACTORS
        if uncertain:
            std = {
                name: math.hypot(x, flights.thrust_std * unit_of_change((effect, name), vehicle))
                for name, x in std.items()
            }
        # shares of the residual's energy without it, each channel over its sensors' noise
        after = self.balance.after
        over = mean_square(flights.visible_noise) ** 0.5 + 1e-12
        left, whole = (
            float(mean_square(x[~flights.fit_rows] / over).mean())
            for x in (after, after + self.parts[effect])
        )
        stated = self._stated(effect, values, std)
        return replace(
            stated,
            tentative=unsure
            or uncertain
            or probability < self._rule.least_sure_probability
            or size < self._rule.least_worth,
            indistinguishable_from=others,
            evidence={
                "energy_explained": max(1.0 - left / whole, 0.0) if whole > 0.0 else 0.0,
                "log_bayes_factor": fitted.posterior.log_bayes_factor(effect),
                "largest_coefficient_in_typical_sizes": max(
                    abs(x) / typical_size((effect, name), vehicle) * (name != CENTRAL)
                    for name, x in values.items()
                ),
                "size_over_what_is_left": size,
                **stated.evidence,
            },
            channels=carrying_channels(flights, fitted.setting, effect),
        )

    def _stated(self, effect: str, values: Values, std: Values) -> NamedEffect:
        """Return an effect with its gain on flight left out of its fit."""
        gained, spread = self.fitted.gains[effect]
        return NamedEffect(
            name=effect,
            coefficients=values,
            std={name: std.get(name, 0.0) for name in values},
            units={name: coefficient((effect, name)).unit for name in values},
            tentative=True,
            indistinguishable_from=(),
            evidence={"held_out_gain": gained, "held_out_gain_std": spread},
        )

    def traces(self) -> Iterator[Trace]:
        """Yield the residual of each piece of flight over time."""
        flights = self._flights
        for rows in flights.runs:
            yield Trace(
                flights.logs[flights.log[rows[0]]].name,
                flights.period,
                flights.t[rows],
                self.balance.before[rows],
                self.balance.after[rows],
                ~flights.fit_rows[rows],
                {effect: part[rows] for effect, part in self.parts.items()},
            )


def _apart(value: float, std: float) -> float:
    """Return the probability of a value with a standard deviation to differ from zero."""
    return math.erf(abs(value) / std / math.sqrt(2.0))


def _segments(flights: RegressedFlights) -> list[tuple[int, float, float]]:
    """Return the held-out stretches of flight: log, from, to (s)."""
    blocks = np.unique(flights.block[~flights.fit_rows])
    ends = [np.flatnonzero(flights.block == b)[[0, -1]] for b in blocks]
    return [(int(flights.log[a]), float(flights.t[a]), float(flights.t[b])) for a, b in ends]


def _predicted(
    flights: RegressedFlights, vehicle: Vehicle, segments: Sequence[tuple[int, float, float]]
) -> Pair:
    """Return how far a model's predictions of the held-out stretches are off: NIS, and m RMS."""
    each = []
    for i, log in enumerate(flights.logs):
        if own := [(a, b) for k, a, b in segments if k == i]:
            distance = rollout_error(log, vehicle, own)
            seconds = sum(b - a for a, b in own)
            each.append((nis_without_wrench_state(log, vehicle, own), distance * distance, seconds))
    nis, squares, weight = np.array(each).reshape(-1, 3).T
    return _mean(nis, weight), math.sqrt(_mean(squares, weight))


def _mean(values: Array, weight: Array) -> float:
    good = np.isfinite(values)
    return float(np.average(values[good], weights=weight[good])) if good.any() else math.nan
