"""The page of a diagnosis's report: one HTML file that needs nothing else.

Its plots are still drawings (SVG). A script and a small library (``uplot/``) replace them by plots
with zoom and cursor where a browser runs scripts. The page's policy allows no other script, and
nothing from elsewhere.
"""

import base64
import hashlib
import json
import math
from collections.abc import Iterable
from functools import cache
from importlib import resources
from typing import Any

from ... import __version__
from ...runtime.page_files import page_template
from ..findings import Diagnosis, NamedEffect, Probabilities
from .first_screen import next_step, sureness_sentences
from .plot_numbers import (
    candidate_bars,
    plot_data,
    plots_of_signatures,
    plots_over_frequency,
    plots_over_time,
)
from .words import (
    MISSING,
    carried_by,
    coefficient_meaning,
    confusion,
    duration,
    effect_summary,
    error_sentences,
    headline,
    in_words,
    percent,
    probability_sentences,
    ranking_sentences,
    remainder_sentence,
    rounded,
    scale_of,
    with_std,
)

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
    time, frequency = plots_over_time(diagnosis), plots_over_frequency(diagnosis)
    signatures, bars = plots_of_signatures(diagnosis), candidate_bars(diagnosis)
    data = plot_data(diagnosis, time, frequency, signatures)
    library, script = _library(), _file("page.js")
    table = error_table(diagnosis)
    return page_template(__package__, "page.html.j2").render(
        headline=headline(diagnosis),
        errors=error_sentences(diagnosis),
        remainder=remainder_sentence(diagnosis),
        sureness=sureness_sentences(diagnosis),
        next_step=next_step(diagnosis),
        policy=_policy((library, script) if data else ()),
        data=_in_script(json.dumps(data, separators=(",", ":"), allow_nan=False)) if data else "",
        library=library,
        library_style=_file("uplot/uPlot.min.css"),
        script=script,
        toggles=data["time"]["effects"] if "time" in data else [],
        verdict=diagnosis.verdict,
        tone=_TONES.get(diagnosis.verdict, "warn"),
        vehicle=diagnosis.declared.name,
        logs=diagnosis.logs,
        test_logs=diagnosis.test_logs,
        seconds=duration(diagnosis.seconds),
        cutoff=f"{diagnosis.cutoff_hz:.3g} Hz",
        effects=[_effect(effect, diagnosis.probabilities) for effect in diagnosis.effects],
        table=table,
        missing=any(MISSING in (row["before"], row["after"]) for row in table),
        held_out=_held_out(diagnosis),
        held_out_sum=_held_out_sum(diagnosis),
        over_time=time,
        over_frequency=frequency,
        pieces=[
            f"{trace.log}, {trace.t[0]:.1f} to {trace.t[-1]:.1f} s" for trace in diagnosis.traces
        ],
        signatures=signatures,
        bars=bars,
        ranking=ranking_sentences(diagnosis),
        floor_is_bound=diagnosis.floor_is_bound,
        more_candidates=[
            f"{c.name} {percent(c.gain)}"
            for c in diagnosis.candidates
            if c.name not in {bar.name for bar in bars}
        ],
        structure=[
            {"where": s.where, "test": s.test, "gain": percent(s.gain)} for s in diagnosis.structure
        ],
        alike=[confusion(effect) for effect in diagnosis.effects if effect.indistinguishable_from],
        probabilities=probability_sentences(diagnosis),
        advice=diagnosis.advice,
        notes=diagnosis.notes,
        command=command,
        version=__version__,
    )


def _in_script(text: str) -> str:
    """Return JSON as it may stand in a page's script element: no tag can begin in it."""
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


@cache
def _file(name: str) -> str:
    """Return a text that stands beside this module."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


@cache
def _library() -> str:
    """Return the plotting library with the licence that must go with it."""
    return f"/*\n{_file('uplot/LICENSE').strip()}\n*/\n{_file('uplot/uPlot.iife.min.js').strip()}"


def _policy(scripts: Iterable[str]) -> str:
    """Return the page's content security policy: these scripts, and nothing that is not in it."""
    hashes = (
        f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'"
        for s in scripts
    )
    allowed = " ".join(hashes) or "'none'"
    return f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src {allowed}"


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
        # an error of zero before and after is one that these logs cannot tell
        told = any(numbers[:2])
        texts = [rounded(factor * number) if told else MISSING for number in numbers]
        if not unit:
            texts[2] = "6"
        table.append(
            {
                "what": what,
                "unit": unit,
                "before": texts[0],
                "after": texts[1],
                "floor": texts[2] if told and math.isfinite(numbers[2]) else "",
            }
        )
    return table


def _effect(effect: NamedEffect, stated: Probabilities | None) -> dict[str, Any]:
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
        "probability": percent(stated.names.get(effect.name, 0.0)) if stated else "",
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
