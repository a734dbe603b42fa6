"""The first sentences of a diagnosis: acting effects, with plain names and quantities."""

from collections.abc import Sequence

from ..findings import Diagnosis, NamedEffect
from .amounts import steady_wrench, title, with_amounts
from .words import in_words, tried


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in plain words, as sure as its least sure part."""
    undecided = [e for e in diagnosis.effects if e.indistinguishable_from]
    rest = [e for e in diagnosis.effects if e not in undecided]
    sure, unsure = ([e for e in rest if e.tentative == told] for told in (False, True))
    if diagnosis.verdict == "nothing to explain":
        return "The model explains these logs: nothing needs to be added to it."
    if diagnosis.verdict == "unexplained" or not diagnosis.effects:
        random, none = diagnosis.remainder == "random", f"no effect {tried(diagnosis)} explains"
        if steady := steady_wrench(diagnosis):
            return (
                f"On average {steady} acts that the model lacks. What changes of its error "
                f"{'looks random' if random else 'has structure'}, and {none} it."
            )
        how = f"looks random: {none} it" if random else f"has structure that {none}"
        return f"The model's error {how}."
    told = []
    if sure:
        told.append(
            f"The model {_lacked(diagnosis, sure)}"
            + (f", and perhaps {_lacked(diagnosis, unsure, sure)}" if unsure else "")
        )
    if undecided:
        told.append(_undecided(diagnosis, undecided))
    if unsure and not sure:
        told.append(f"The model perhaps {_lacked(diagnosis, unsure)}")
    if diagnosis.verdict == "partly explained" and diagnosis.remainder != "none":
        told[-1] += (
            ", and an error is left that may or may not be the sensors' noise"
            if diagnosis.floor_is_bound and diagnosis.remainder == "random"
            else ", and an unexplained error is left"
        )
    return " ".join(f"{sentence}." for sentence in told)


def _undecided(diagnosis: Diagnosis, effects: Sequence[NamedEffect]) -> str:
    """Return one sentence on effects indistinguishable in these logs."""
    pairs = [
        f"{with_amounts(e, diagnosis.declared)} from "
        f"{in_words([title(x) for x in e.indistinguishable_from], 'or')}"
        for e in effects
    ]
    declared = {e.name for e in diagnosis.declared.effects}
    known = declared & {x for e in effects for x in (e.name, *e.indistinguishable_from)}
    perhaps = "perhaps " if any(e.tentative for e in effects) else ""
    what = "one of them" if len(effects) == 1 else "one of each"
    model = f"is {perhaps}wrong in" if known else f"{perhaps}lacked"
    return f"These logs cannot tell {', or '.join(pairs)}: the model {model} {what}"


def _lacked(
    diagnosis: Diagnosis, effects: Sequence[NamedEffect], before: Sequence[NamedEffect] = ()
) -> str:
    """Return effects in words: new to the model, or declared with other coefficients.

    After effects ``before``, all new like these, the verb is not repeated.
    """
    declared = {e.name: set(e.coefficients) for e in diagnosis.declared.effects}
    changed = [
        e.name
        for e in (*before, *effects)
        if e.name in declared and e.coefficients.keys() <= declared[e.name]
    ]
    if before and not changed:
        return in_words([with_amounts(e, diagnosis.declared) for e in effects])
    new = in_words([with_amounts(e, diagnosis.declared) for e in effects if e.name not in changed])
    other = in_words([title(e.name) for e in effects if e.name in changed])
    told = [
        f"lacked {new}" if new else "",
        f"declares {other} with wrong coefficients" if other else "",
    ]
    return in_words([*filter(None, told)])
