"""What the first screen of a report answers: how sure the names are, and what to do next.

What is missing is the headline, and how much better the model is are the error's sentences, both in
``words.py``.
"""

import math

from ...dynamics.effects import get, names
from ..findings import Diagnosis, NamedEffect
from .words import doubt_sentences, duration, in_words, percent

_LONGEST = 190  # letters of a piece of advice on the first screen


def sureness_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return how sure each name is, and what the answer rests on."""
    sure = [e for e in diagnosis.effects if not e.tentative and not e.indistinguishable_from]
    told = _probability(diagnosis)
    if sure:
        spreads = in_words([words for effect in sure for words in _spreads(effect)])
        told.append(
            f"{in_words([e.name for e in sure])}: no other effect of the library explains the "
            f"flight as well{f' ({spreads}, standard deviations)' if spreads else ''}."
        )
    told += _doubts(diagnosis)
    if not diagnosis.effects:
        told.append(
            "The residual was tested for random disturbances and for structure, and "
            f"{len(diagnosis.candidates)} effects were tried."
            if diagnosis.candidates
            else "No effect was tried on it."
        )
    blocks = len(diagnosis.held_out_segments)
    if blocks:
        total = sum(end - start for _, start, end in diagnosis.held_out_segments)
        told.append(
            f"Errors are on {'test logs' if diagnosis.test_logs else 'held-out data'}: "
            f"{blocks} {'block' if blocks == 1 else 'blocks'}, {duration(total)}, that no fit used."
        )
    return told


def _probability(diagnosis: Diagnosis) -> list[str]:
    """Return how probable the names are, and that something unknown acts; nothing where that was
    not asked.
    """
    stated = diagnosis.probabilities
    if stated is None:
        return []
    names = [f"{e.name} {percent(stated.names.get(e.name, 0.0))}" for e in diagnosis.effects]
    acts = f"Probability that it acts: {in_words(names)}. " if names else ""
    return [f"{acts}Probability of a cause outside the library: {percent(stated.unknown)}."]


def _doubts(diagnosis: Diagnosis) -> list[str]:
    """Return what the names do not settle, in two sentences: the headline has the alternatives."""
    undecided = [e.name for e in diagnosis.effects if e.indistinguishable_from]
    told = doubt_sentences(diagnosis)
    if len(undecided) < 2:
        return told
    alike = f"For {in_words(undecided)}, another effect explains these logs equally well."
    return [alike, *told[len(undecided) :]]


def _spreads(effect: NamedEffect) -> list[str]:
    """Return how well each coefficient is known, in per cent of it."""
    found = []
    for name, value in effect.coefficients.items():
        std = effect.std.get(name, math.nan)
        if value and math.isfinite(value) and math.isfinite(std) and std > 0:
            found.append(f"{name} ± {percent(std / abs(value))}")
    return found


def next_step(diagnosis: Diagnosis) -> str:
    """Return the one thing to do next, in a sentence or two."""
    undecided = [e for e in diagnosis.effects if e.indistinguishable_from]
    first = diagnosis.advice[0] if diagnosis.advice else ""
    if undecided and not first.startswith("Log "):
        effect = undecided[0]
        others = in_words(effect.indistinguishable_from, "or")
        if effect.name in names():
            return _short(
                f"To tell {effect.name} from {others}, fly: {get(effect.name).excitation}."
            )
    if diagnosis.verdict in ("explained", "nothing to explain"):
        use = (
            "Use vehicle.yaml, which holds the named effects, in place of the declared vehicle"
            if diagnosis.effects
            else "Keep the model as it is"
        )
        return f"{use}, and confirm it on another flight (--test)."
    if first:
        return _short(first)
    use = "Use vehicle.yaml, which holds the named effects. " if diagnosis.effects else ""
    return f"{use}To see whether the rest is wind, fly again in still air."


def _short(text: str) -> str:
    """Return the beginning of a text: whole sentences if it can be, or else whole clauses."""
    if len(text) <= _LONGEST:
        return text
    kept = text[: _LONGEST + 1]
    end = kept.rfind(". ")
    if end > 0:
        return kept[: end + 1]
    end = max(kept.rfind(mark) for mark in (", ", "; ", ": "))
    return kept[: end if end > _LONGEST // 3 else kept.rfind(" ")].rstrip(",:; ") + " …"
