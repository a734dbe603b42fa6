"""The tables of the study, and the page that holds them between two marks."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from windwrench.runtime.errors import InputError
from windwrench.runtime.whole_files import replaced
from windwrench.studies.filtered_logs.page import BEGIN, END, interval
from windwrench.studies.imu_logs.imu_logs import can_show, kind, named

KINDS = ("wrong, sure", "wrong, tentative", "silent", "refused", "right, tentative", "right, sure")


def tables(outcomes: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown: losses, counts by kind of log, each effect, coefficients."""
    logs = list(dict.fromkeys(o["log"] for o in outcomes))
    groups: list[tuple[str, list[Mapping[str, Any]]]] = []
    for name in logs:
        own = [o for o in outcomes if o["log"] == name]
        added = [o for o in own if o["effect"]]
        groups += [
            (f"{name}: effects that it can show", [o for o in added if can_show(o)]),
            (f"{name}: effects that it lists as not shown", [o for o in added if not can_show(o)]),
            (f"{name}: nothing added", [o for o in own if not o["effect"]]),
        ]
    rows = []
    for title, own in groups:
        kinds = [kind(o) for o in own]
        found = interval(sum(map(named, own)), len(own)) if "nothing" not in title else "–"
        wrong = interval(kinds.count("wrong, sure"), len(own))
        rows.append([title, found, wrong, *(str(kinds.count(k)) for k in KINDS[1:])])
    errors = []
    for name in logs:
        own_errors = [e for o in outcomes if o["log"] == name for e in o["errors"].values()]
        z = np.array([e[1] for e in own_errors])
        relative = np.array([e[0] for e in own_errors])
        errors.append(
            [
                name,
                f"{100 * np.median(relative):.1f} %" if len(z) else "–",
                interval(int(np.sum(z <= 1.96)), len(z)),
            ]
        )
    return "\n\n".join(
        [
            _losses(outcomes),
            _table(["log", "named", *KINDS], rows),
            _table(["log", "median error of a coefficient", "within 1.96 std"], errors),
            _effects(outcomes, logs),
        ]
    )


def _losses(outcomes: Sequence[Mapping[str, Any]]) -> str:
    sure = [o for o in outcomes if kind(o) == "wrong, sure"]
    missed = [o for o in outcomes if o["effect"] and can_show(o) and not named(o)]
    return "\n\n".join(
        f"{title}: {len(own)}."
        + "".join(
            f"\n* {o['log']}, {o['effect'] or 'nothing added'} ({o['trajectory']}): {_words(o)}"
            for o in own
        )
        for title, own in (("Sure and wrong", sure), ("Shown and not named", missed))
    )


def _words(outcome: Mapping[str, Any]) -> str:
    if "refused" in outcome:
        return str(outcome["refused"])
    return (
        ", ".join(
            " or ".join((e["name"], *e["indistinguishable_from"])) + ("?" if e["tentative"] else "")
            for e in outcome["effects"]
        )
        or "nothing"
    )


def _effects(outcomes: Sequence[Mapping[str, Any]], logs: Sequence[str]) -> str:
    rows = []
    for effect in dict.fromkeys(o["effect"] for o in outcomes if o["effect"]):
        row = [effect]
        for name in logs:
            own = [o for o in outcomes if o["effect"] == effect and o["log"] == name]
            row.append(
                "; ".join(_words(o) + ("" if can_show(o) else " (listed)") for o in own) or "–"
            )
        carried = {
            c
            for o in outcomes
            if o["effect"] == effect
            for e in o["effects"]
            if e["name"] == effect
            for c in e["channels"]
        }
        rows.append([*row, ", ".join(sorted(carried))])
    return _table(["added", *logs, "carried by"], rows)


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
