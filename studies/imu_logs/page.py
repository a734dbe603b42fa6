"""The tables of the study."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from windwrench.studies.imu_logs.imu_logs import can_show, named
from windwrench.studies.page_tables import share, table
from windwrench.studies.scored_flights import KINDS, kind


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
        found = share(sum(map(named, own)), len(own)) if "nothing" not in title else "–"
        wrong = share(kinds.count("wrong, sure"), len(own))
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
                share(int(np.sum(z <= 1.96)), len(z)),
            ]
        )
    return "\n\n".join(
        [
            _losses(outcomes),
            table(["log", "named", *KINDS], rows),
            table(["log", "median error of a coefficient", "within 1.96 std"], errors),
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
    return table(["added", *logs, "carried by"], rows)
