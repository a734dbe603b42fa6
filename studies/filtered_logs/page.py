"""The tables of the study, and the page that holds them between two marks."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from windwrench.runtime.errors import InputError
from windwrench.runtime.whole_files import replaced
from windwrench.studies.filtered_logs.filtered_logs import kind

KINDS = ("wrong, sure", "wrong, tentative", "silent", "refused", "right, tentative", "right, sure")
BEGIN, END = "<!-- tables: begin -->", "<!-- tables: end -->"


def interval(count: int, whole: int) -> str:
    """Return a count of a whole and its 95 % interval (Wilson) in per cent."""
    if not whole:
        return "–"
    low, high = binomtest(count, whole).proportion_ci(method="wilson")
    return f"{count} of {whole} ({100 * low:.0f}–{100 * high:.0f} %)"


def tables(outcomes: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown: names and coefficients by filter, then the losses one by
    one.
    """
    filters = list(dict.fromkeys(o["filter"] for o in outcomes))
    rows, z_rows = [], []
    for name in filters:
        own = [o for o in outcomes if o["filter"] == name]
        kinds = [kind(o) for o in own]
        found = sum(o["detected"] for o in own)
        rows.append([name, interval(found, len(own)), *(str(kinds.count(k)) for k in KINDS)])
        errors = [e for o in own for e in o["errors"].values()]
        relative = np.array([e[0] for e in errors])
        z = np.array([e[1] for e in errors])
        z_rows.append(
            [
                name,
                f"{100 * np.median(relative):.1f} %" if len(z) else "–",
                interval(int(np.sum(z <= 1.96)), len(z)),
                f"{np.sqrt(np.mean(np.minimum(z, 10.0) ** 2)):.1f}" if len(z) else "–",
                f"{np.median(z):.2f}" if len(z) else "–",
            ]
        )
    parts = [
        _losses(outcomes),
        _table(["pose", "recognised as filtered", *KINDS], rows),
        _table(
            ["pose", "median error", "within 1.96 std", "rms of z (at most 10)", "median of z"],
            z_rows,
        ),
    ]
    return "\n\n".join(parts)


def _losses(outcomes: Sequence[Mapping[str, Any]]) -> str:
    lost = [
        f"* {o['filter']}, {o['effect'] or 'nothing added'} ({o['trajectory']}): "
        + ", ".join(
            e["name"] + ("" if not e["indistinguishable_from"] else " or others")
            for e in o["effects"]
            if not e["tentative"]
        )
        for o in outcomes
        if kind(o) == "wrong, sure"
    ]
    missed = [
        f"* {o['filter']}, {o['effect'] or 'nothing added'} ({o['trajectory']}): not recognised"
        for o in outcomes
        if (o["filter"] != "as measured") != o["detected"]
    ]
    return (
        f"Sure and wrong: {len(lost)}." + "".join(f"\n{line}" for line in lost) + "\n\n"
        f"Filtered and not recognised, or the reverse: {len(missed)}."
        + "".join(f"\n{line}" for line in missed)
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def write_table(outcomes: Sequence[Mapping[str, Any]], page: Path | None) -> str:
    """Return the tables, and put them between the marks of a page.

    Raises:
        InputError: the page lacks the marks.
    """
    text = tables(outcomes)
    if page is not None:
        old = page.read_text(encoding="utf-8")
        if old.count(BEGIN) != 1 or old.count(END) != 1:
            raise InputError(f"{page}: expected one line {BEGIN} and one {END}")
        before, rest = old.split(BEGIN)
        with replaced(page) as partial:
            partial.write_text(
                f"{before}{BEGIN}\n\n{text}\n\n{END}{rest.split(END)[1]}", encoding="utf-8"
            )
    return text
