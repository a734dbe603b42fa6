"""First sentences: a doubt about the log, then the causes missing in a model by the energy of each,
or the mean of an estimated wrench. Two sentences at most.
"""

import math

import numpy as np

from ..findings import Diagnosis, NamedEffect
from ..logs.table import finite_rows, median_step
from ..wrench_series import WrenchSeries
from .amounts import known, steady_wrench, title, with_amounts
from .words import (
    by_energy,
    chance,
    disturbance_at,
    disturbances,
    energy,
    error_of_the_effects,
    first_doubt,
    in_unit,
    in_words,
    is_outside,
    tried,
    warnings_in,
)

_MOST_OF_IT = 0.5  # share of the energy, from which a tentative effect stands before gusts
_NAMED = 3  # effects in the sentence; the table has the others


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in plain words: a cause outside the library where one is likeliest, else
    the effects by the energy that each explains, else the disturbance.
    """
    doubt = first_doubt(warnings_in(diagnosis.notes))
    return " ".join([*doubt, _verdict(diagnosis), *error_of_the_effects(diagnosis)][:2])


def _verdict(diagnosis: Diagnosis) -> str:
    """Return the sentence on causes, or on a disturbance."""
    if diagnosis.verdict == "nothing to explain":
        return "The model explains these logs."
    if is_outside(diagnosis):
        hidden = " (or hidden in these logs)" if diagnosis.needs_pose else ""
        sign = disturbance_at(diagnosis) if diagnosis.pushes else ""
        if diagnosis.structure:
            sign = f"in {diagnosis.structure[0].where}"
        told = f"; its clearest sign is {sign}" if sign else ""
        likely = chance(diagnosis.probabilities.unknown)
        return f"A cause outside the library{hidden} acts (probability {likely}){told}."
    gusts, library = disturbances(diagnosis), f"o effect {tried(diagnosis)}"
    if diagnosis.effects:
        sure = [e for e in diagnosis.effects if not e.tentative or energy(e) > _MOST_OF_IT]
        rest = "" if sure or not gusts else f"he residual looks random{gusts}; t"
        return f"T{rest}he model {_lacks(diagnosis)}."
    pieces = [(trace.after, trace.period) for trace in diagnosis.traces]
    if steady := steady_wrench(pieces, diagnosis.floor_force_rms, diagnosis.floor_torque_rms):
        return f"Unmodelled {steady} on average; n{library} explains it."
    if diagnosis.pushes:
        clearest = disturbance_at(diagnosis)
        return f"Transient disturbances act, the clearest {clearest}; n{library} explains them."
    if gusts:
        return f"N{library} is needed; the residual looks random{gusts}."
    return f"The residual looks random; n{library} explains it."


def _lacks(diagnosis: Diagnosis) -> str:
    """Return the missing effects with their amounts, the largest energy first. Effects of unknown
    amounts are counted alone.
    """
    order = by_energy(diagnosis)
    named = [effect for effect in order if known(effect)][:_NAMED] or order[:1]
    perhaps = all(effect.tentative for effect in named)
    told = [_told(effect, diagnosis, perhaps) for effect in named]
    if more := len(order) - len(named):
        told.append(f"and {more} more")
    return f"{'perhaps ' * perhaps}lacks {'; '.join(told)}"


def _told(effect: NamedEffect, diagnosis: Diagnosis, all_perhaps: bool) -> str:
    """Return one effect with its amount and its rivals; declared ones as wrong coefficients."""
    declared = {e.name: e.coefficients.keys() for e in diagnosis.declared.effects}
    told = with_amounts(effect, diagnosis.declared)
    if effect.coefficients.keys() <= declared.get(effect.name, set()):
        told = f"the right {told}"
    told = in_words([told, *map(title, effect.indistinguishable_from)], "or")
    return f"{told} (perhaps)" if effect.tentative and not all_perhaps else told


def wrench_headline(series: WrenchSeries) -> str:
    """Return the mean external force and torque, if beyond chance and its stated deviation, and the
    force's spread.
    """
    rows = finite_rows(series.force)
    wrench = np.nan_to_num(np.hstack([series.force, series.torque])[rows])
    force, torque = (
        float(np.median(np.nan_to_num(std[rows]), axis=0).max())
        for std in (series.std_force, series.std_torque)
    )
    told = steady_wrench([(wrench, median_step(series.t))], force, torque)
    mean = f"Unmodelled {told}" if told else f"No unmodelled force above {in_unit(force, 'N')}"
    spread = in_unit(math.sqrt(wrench[:, :3].var(axis=0).sum()), "N")
    doubt = first_doubt(warnings_in(series.notes))
    return " ".join([*doubt, f"{mean} on average; the force varies by {spread} rms."])
