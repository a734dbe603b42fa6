"""The tables of the study."""

from collections.abc import Mapping, Sequence
from typing import Any

from .study import FULL, MODELS, PUBLISHED, SETTINGS

_ALLOWED = 1.5  # times the published estimator's error, of the past alone
_WAYS = {
    "others": "all other flights",
    "one": "{}",
    "blocks": "all but the block",
    "all": "all, this one too",
}


def tables(found: Mapping[str, Any]) -> str:
    """Return the tables of a study's result as Markdown: the losses first."""
    force = found["force"]
    flights = list(dict.fromkeys(row["flight"] for row in force))
    parts = [_losses(force, flights), _full(force), _nested(force, flights)]
    parts.append(_coefficients(force))
    if found["filter"]:
        parts += [_filter_losses(found["filter"]), _filter(found["filter"])]
    parts.append(_pose(found["pose"]))
    return "\n\n".join(parts)


def _published(flight: str, which: int) -> float | None:
    figures = PUBLISHED.get(flight[-1])
    return None if figures is None else figures[which]


def _figure(row: Mapping[str, Any]) -> str:
    low, high = row["interval"]
    return f"{row['rmse']:.3f} ({low:.3f}–{high:.3f})"


def _losses(force: Sequence[Mapping[str, Any]], flights: Sequence[str]) -> str:
    """Say on which flights which way of fitting stays above the published network."""
    lines = []
    for row in force:
        network = _published(row["flight"], 0)
        if row["model"] == FULL and row["way"] != "all" and network and row["rmse"] >= network:
            on = _WAYS[row["way"]].format(row["fitted_on"])
            lines.append(
                f"* {row['flight']}, fitted on {on}: {row['rmse']:.3f} N, network {network:.3f}"
            )
    return f"Above the published network: {len(lines)}." + "".join(f"\n{line}" for line in lines)


def _full(force: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for row in (row for row in force if row["model"] == FULL):
        network = _published(row["flight"], 0)
        rows.append(
            [
                row["flight"],
                _WAYS[row["way"]].format(row["fitted_on"]),
                _figure(row),
                f"{row['rmse_below_5_hz']:.3f}",
                f"{row['rmse_own_scale']:.3f}" if "rmse_own_scale" in row else "–",
                f"{row['doubt']:.3f}" if "doubt" in row else "–",
                "–" if network is None else f"{network:.3f}",
            ]
        )
    head = [
        "flight",
        "fitted on",
        "N, full rate (95 %)",
        "below 5 Hz",
        "with the thrust scale of its first second",
        "of it, coefficients' own uncertainty",
        "network",
    ]
    return _table(head, rows)


def _nested(force: Sequence[Mapping[str, Any]], flights: Sequence[str]) -> str:
    rows = []
    for label, (coefficients, filtered) in MODELS.items():
        cells = [label, str(len(coefficients) + filtered)]
        for flight in flights:
            by_way = {
                row["way"]: row
                for row in force
                if row["model"] == label and row["flight"] == flight
            }
            cells.append(" / ".join(f"{by_way[way]['rmse']:.3f}" for way in ("others", "blocks")))
        rows.append(cells)
    measured = {row["flight"]: row for row in force if row["way"] == "published"}
    if measured:
        rows.append(
            [
                "published network",
                "–",
                *(_figure(measured[f]) if f in measured else "–" for f in flights),
            ]
        )
    return _table(["model", "coefficients", *flights], rows)


def _coefficients(force: Sequence[Mapping[str, Any]]) -> str:
    row = next(row for row in force if row["model"] == FULL and row["way"] == "all")
    rows = [[name, f"{value:.3g}"] for name, value in row["coefficients"].items()]
    rows.append(["low-pass of the logged force", f"{row['cutoff_hz']:g} Hz"])
    return _table(["coefficient, fitted on all flights", "value"], rows)


def _filter_losses(filtered: Sequence[Mapping[str, Any]]) -> str:
    """Say where the filter on the past alone stays above what the published estimator allows it."""
    lines = []
    for row in filtered:
        published = _published(row["flight"], 1)
        if published and not row["smooth"] and row["rmse"] > _ALLOWED * published:
            lines.append(
                f"* {row['flight']}, {row['measured']} measured, {row['vehicle']}: "
                f"{row['rmse'] / published:.2f} times {published:.3f} N"
            )
    head = f"Above {_ALLOWED:g} times the published estimator, of the past alone: {len(lines)}."
    return head + "".join(f"\n{line}" for line in lines)


def _filter(filtered: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for row in filtered:
        published = _published(row["flight"], 1)
        rows.append(
            [
                row["flight"],
                row["measured"],
                row["vehicle"],
                "smoothed" if row["smooth"] else "the past alone",
                _figure(row),
                f"{row['rmse_slow']:.3f} / {row['rmse_fast']:.3f}",
                "–" if published is None else f"{published:.3f}",
                "–" if published is None else f"{row['rmse'] / published:.2f}",
            ]
        )
    head = [
        "flight",
        "measured",
        "vehicle",
        "estimate",
        "N, total force (95 %)",
        f"below / above {SETTINGS.split_hz:g} Hz",
        "published estimator",
        "ratio",
    ]
    return _table(head, rows)


def _pose(flights: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        [
            row["flight"],
            f"{row['seconds']:.0f}",
            f"{row['fastest']:.1f}",
            f"{row['rmse']:.3f}",
            f"{1e3 * row['position_noise']:.3f}",
        ]
        for row in flights
    ]
    head = [
        "flight",
        "s",
        "fastest, m/s",
        "force against that of its own velocity, N",
        "position against its own velocity, above 5 Hz, mm an axis",
    ]
    return _table(head, rows)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
