"""The tables of the study."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from windwrench.studies.page_tables import share, table
from windwrench.studies.scored_flights import KINDS, kind


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
        rows.append([name, share(found, len(own)), *(str(kinds.count(k)) for k in KINDS)])
        errors = [e for o in own for e in o["errors"].values()]
        relative = np.array([e[0] for e in errors])
        z = np.array([e[1] for e in errors])
        z_rows.append(
            [
                name,
                f"{100 * np.median(relative):.1f} %" if len(z) else "–",
                share(int(np.sum(z <= 1.96)), len(z)),
                f"{np.sqrt(np.mean(np.minimum(z, 10.0) ** 2)):.1f}" if len(z) else "–",
                f"{np.median(z):.2f}" if len(z) else "–",
            ]
        )
    parts = [
        _losses(outcomes),
        table(["pose", "recognised as filtered", *KINDS], rows),
        table(
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
