"""First sentences: causes missing in a model, by the energy of each, and the mean of an estimated
wrench.
"""

import math

import numpy as np

from ..findings import Diagnosis, NamedEffect
from ..logs.table import finite_rows, median_step
from ..wrench_series import WrenchSeries
from .amounts import known, steady_residual, steady_wrench, title, with_amounts
from .words import (
    by_energy,
    chance,
    disturbance_at,
    doubts,
    error_amounts,
    in_unit,
    in_words,
    is_outside,
    percent,
    tried,
    without_warning,
)

_NAMED = 4  # effects in the sentence; the table has the others
_UNDECIDED = 0.1  # share of its energy by which an undecided effect is ordered


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in plain words: a cause outside the library where one is likeliest, else
    the effects by the energy that each explains, undecided ones last.
    """
    error = next(error_amounts(diagnosis))
    if diagnosis.verdict == "nothing to explain":
        return f"The model explains these logs; {error}."
    lacking = _lacking(diagnosis)
    if is_outside(diagnosis):
        hidden = ", or hidden in these logs," if diagnosis.needs_pose else ""
        rest = f"H{error[1:]}"
        if lacking:
            rest = f"Effects of the library that imitate the cause, no findings: {lacking}"
        return (
            f"A cause outside the library{hidden} acts "
            f"(probability {chance(diagnosis.probabilities.unknown)}){_sign(diagnosis)}. {rest}."
        )
    if lacking:
        perhaps = "perhaps " if all(e.tentative for e in diagnosis.effects) else ""
        return f"The model {perhaps}lacks {lacking}."
    looks = "looks random" if diagnosis.remainder == "random" else "has structure"
    if steady := steady_residual(diagnosis):
        steady = f"On average {steady} acts that the model lacks. "
    return (
        f"{steady}H{error[1:]}; the residual {looks}, and no effect {tried(diagnosis)} explains it."
    )


def _sign(diagnosis: Diagnosis) -> str:
    """Return the clearest sign of a cause outside the library: a doubtful log, a variable, or a
    transient disturbance.
    """
    if suspects := [text for text in doubts(diagnosis) if without_warning(text) != text]:
        return f". First suspect: {without_warning(suspects[0])}"
    if diagnosis.structure:
        clearest = diagnosis.structure[0]
        return (
            f"; its clearest sign is in {clearest.where}, {percent(clearest.gain)} of the residual"
        )
    return f"; its clearest sign is {disturbance_at(diagnosis)}" if diagnosis.pushes else ""


def _lacking(diagnosis: Diagnosis) -> str:
    """Return the effects with their amounts: the largest energy first, undecided ones after decided
    ones with a tenth of their energy, and unknown amounts last.
    """

    def place(effect: NamedEffect) -> tuple[bool, float]:
        share = _UNDECIDED if effect.indistinguishable_from else 1.0
        return not known(effect), -share * effect.evidence.get("energy_explained", 0.0)

    largest = by_energy(diagnosis)[:_NAMED]
    all_perhaps = is_outside(diagnosis) or all(e.tentative for e in diagnosis.effects)
    told = [_told(e, diagnosis, all_perhaps) for e in sorted(largest, key=place)]
    if more := len(diagnosis.effects) - len(told):
        told.append(f"and {more} smaller")
    return "; ".join(told)


def _told(effect: NamedEffect, diagnosis: Diagnosis, all_perhaps: bool) -> str:
    """Return one effect with its amount and its rivals; declared ones as wrong coefficients."""
    declared = {e.name: e.coefficients.keys() for e in diagnosis.declared.effects}
    told = with_amounts(effect, diagnosis.declared)
    if effect.coefficients.keys() <= declared.get(effect.name, set()):
        told = f"the right {told}"
    if rivals := [title(name) for name in effect.indistinguishable_from]:
        told = f"one of {in_words([told, *rivals], 'or')}"
    return f"perhaps {told}" if effect.tentative and not all_perhaps else told


def wrench_headline(series: WrenchSeries) -> str:
    """Return the mean external force and torque, if beyond chance and its stated deviation, and the
    force's spread.
    """
    rows = finite_rows(series.force)
    wrench = np.nan_to_num(np.hstack([series.force, series.torque])[rows])
    stated = np.hstack([series.std_force, series.std_torque])[rows]
    std = np.median(np.nan_to_num(stated), axis=0)
    floors = std[:3].max(), std[3:].max()
    told = (
        steady_wrench([wrench], [median_step(series.t)], floors)
        or f"no steady force above {in_unit(floors[0], 'N')}"
    )
    spread = in_unit(math.sqrt(wrench[:, :3].var(axis=0).sum()), "N")
    return (
        f"Beside the model of {series.vehicle.name}, on average {told} acts; the force is {spread} "
        "rms about its mean."
    )
