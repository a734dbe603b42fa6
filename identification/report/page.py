"""The page of a diagnosis's report: one HTML file that needs nothing else, without a script."""

import math
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from ... import __version__
from ..findings import Diagnosis, NamedEffect
from .pictures import (
    draw_candidates,
    draw_over_frequency,
    draw_over_time,
    draw_signatures,
    shown_candidates,
)
from .words import (
    MISSING,
    carried_by,
    coefficient_meaning,
    confusion,
    doubt_sentences,
    duration,
    effect_summary,
    error_sentences,
    headline,
    in_words,
    percent,
    ranking_sentences,
    remainder_sentence,
    rounded,
    scale_of,
    with_std,
)

if TYPE_CHECKING:
    from jinja2 import Template

_TONES = {
    "explained": "good",
    "nothing to explain": "good",
    "partly explained": "warn",
    "unexplained": "bad",
}


def report_page(diagnosis: Diagnosis, command: str) -> str:
    """Return the page (HTML); ``command`` is what made it. Every text is escaped: names of files
    come from users.
    """
    shown = shown_candidates(diagnosis)
    return _template().render(
        headline=headline(diagnosis),
        errors=error_sentences(diagnosis),
        remainder=remainder_sentence(diagnosis),
        doubts=doubt_sentences(diagnosis),
        verdict=diagnosis.verdict,
        tone=_TONES.get(diagnosis.verdict, "warn"),
        vehicle=diagnosis.declared.name,
        logs=diagnosis.logs,
        test_logs=diagnosis.test_logs,
        seconds=duration(diagnosis.seconds),
        cutoff=f"{diagnosis.cutoff_hz:.3g} Hz",
        effects=[_effect(effect) for effect in diagnosis.effects],
        table=error_table(diagnosis),
        missing=any(MISSING in (row["before"], row["after"]) for row in error_table(diagnosis)),
        held_out=_held_out(diagnosis),
        held_out_sum=_held_out_sum(diagnosis),
        over_time=draw_over_time(diagnosis),
        over_frequency=draw_over_frequency(diagnosis),
        pieces=[
            f"{trace.log}, {trace.t[0]:.1f} to {trace.t[-1]:.1f} s" for trace in diagnosis.traces
        ],
        signatures=draw_signatures(diagnosis),
        candidates=draw_candidates(diagnosis),
        ranking=ranking_sentences(diagnosis),
        floor_is_bound=diagnosis.floor_is_bound,
        more_candidates=[
            f"{c.name} {percent(c.gain)}" for c in diagnosis.candidates if c not in shown
        ],
        structure=[
            {"where": s.where, "test": s.test, "gain": percent(s.gain)} for s in diagnosis.structure
        ],
        alike=[confusion(effect) for effect in diagnosis.effects if effect.indistinguishable_from],
        advice=diagnosis.advice,
        notes=diagnosis.notes,
        command=command,
        version=__version__,
    )


@cache
def _template() -> "Template":
    from jinja2 import Environment, StrictUndefined

    source = resources.files(__package__).joinpath("page.html.j2").read_text(encoding="utf-8")
    return Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    ).from_string(source)


def evidence_words(key: str) -> str:
    """Return what a key of ``NamedEffect.evidence``, which ``report.json`` has as it is, stands
    for.
    """
    words = {
        "energy_explained": "share of the deviance explained",
        "energy_explained_in_noise_units": "deviance explained",
        "largest_coefficient_in_typical_sizes": "largest coefficient in typical sizes",
    }
    return words.get(key, key.replace("_", " "))


def error_table(diagnosis: Diagnosis) -> list[dict[str, str]]:
    """Return the rows of the error before, after and at the floor: what, unit and three rounded
    numbers.
    """
    before, after, unknown = diagnosis.before, diagnosis.after, math.nan
    rows = [
        ("Force, rms", "N", before.force_rms, after.force_rms, diagnosis.floor_force_rms),
        ("Torque, rms", "Nm", before.torque_rms, after.torque_rms, diagnosis.floor_torque_rms),
        (
            "Position after 1 s of prediction, rms",
            "m",
            before.rollout_1s_position_rms,
            after.rollout_1s_position_rms,
            unknown,
        ),
        (
            "NIS of a filter without wrench states, mean",
            "",
            before.nis_without_wrench_state,
            after.nis_without_wrench_state,
            6.0,
        ),
    ]
    table = []
    for what, unit, *numbers in rows:
        factor, unit = scale_of(numbers, unit) if unit else (1.0, "")
        texts = [rounded(factor * number) for number in numbers]
        if not unit:
            texts[2] = "6"
        table.append(
            {
                "what": what,
                "unit": unit,
                "before": texts[0],
                "after": texts[1],
                "floor": "" if math.isnan(numbers[2]) else texts[2],
            }
        )
    return table


def _effect(effect: NamedEffect) -> dict[str, Any]:
    rows = []
    for name, value in effect.coefficients.items():
        unit = effect.units.get(name, "")
        rows.append(
            {
                "name": name,
                "value": with_std(value, effect.std.get(name, math.nan)),
                "unit": "" if unit == "1" else unit,
                "meaning": coefficient_meaning(effect.name, name),
            }
        )
    evidence = ", ".join(
        f"{evidence_words(key)} {percent(value) if 'share' in key else rounded(value)}"
        for key, value in effect.evidence.items()
    )
    return {
        "name": effect.name,
        "others": in_words(effect.indistinguishable_from, "or"),
        "tentative": effect.tentative,
        "summary": effect_summary(effect.name),
        "evidence": evidence,
        "rows": rows,
        "carried": carried_by(effect),
    }


def _held_out(diagnosis: Diagnosis) -> list[str]:
    """Return a line a log with the blocks that were held out of it."""
    lines: dict[str, list[str]] = {}
    for log, start, end in diagnosis.held_out_segments:
        lines.setdefault(log, []).append(f"{start:.1f}–{end:.1f}")
    return [f"{log}: {', '.join(blocks)} s" for log, blocks in lines.items()]


def _held_out_sum(diagnosis: Diagnosis) -> str:
    count = len(diagnosis.held_out_segments)
    total = sum(end - start for _, start, end in diagnosis.held_out_segments)
    return f"{count} {'block' if count == 1 else 'blocks'}, {duration(total)}"
