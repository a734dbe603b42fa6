"""A leaderboard in words and columns, and as a file."""

import json
import math
from collections.abc import Sequence
from pathlib import Path

from ..runtime.page_files import write_text
from ..runtime.plain_values import plain
from .leaderboard import SETTLED, Standing, shown
from .tasks import short_names, task_of

_CLEAR = 0.05  # p-value, corrected


def write_leaderboard(rows: Sequence[Standing], folder: Path) -> Path:
    """Write the rows as ``leaderboard.json``, at once or not at all; return its path.

    A number without a meaning is null.
    """
    path = folder / "leaderboard.json"
    write_text(json.dumps(plain(rows), indent=1, allow_nan=False) + "\n", path)
    return path


def summary(rows: Sequence[Standing]) -> str:
    """Return the rows in words, a scenario a line: losses first, then the policies better or worse
    than the best designed law at a corrected p-value below 0.05.
    """
    lines = []
    for scenario in dict.fromkeys(row.scenario for row in rows):
        some = [row for row in shown(rows) if row.scenario == scenario]
        lost: dict[str, list[str]] = {}
        for row in sorted(some, key=lambda row: -row.lost_fraction):
            lost.setdefault(_lost(row), []).append(f"`{row.controller}`")
        losses = "; ".join(f"{', '.join(names)} {count}" for count, names in lost.items())
        if not any(row.lost_episodes for row in some):
            losses = "nothing"
        judged = [row for row in some if row.p_over_best is not None and row.p_over_best < _CLEAR]
        better = [row for row in judged if row.change_over_best < 0]
        worse = [row for row in judged if row.change_over_best > 0]
        truth = ", ".join(f"`{row.controller}`" for row in some if row.uses_truth)
        line = f"* **{scenario}**, {some[0].episodes} episodes each. Terminated: {losses}."
        if truth:
            line += f" With the truth or a preview: {truth}."
        if some[0].ranked_by == SETTLED:
            line += (
                f" Against the best designed law there, `{some[0].best_law}`: clearly worse "
                f"{_listed(worse)}; clearly better {_listed(better)}."
            )
        else:
            line += " The task states no error: ranked by the return."
        lines.append(line)
    return "\n".join(lines) + "\n" if lines else ""


def _listed(rows: Sequence[Standing]) -> str:
    return (
        ", ".join(
            f"`{row.controller}` {_change_text(row.change_over_best, row.change_over_best_ci95)}"
            for row in rows
        )
        or "none"
    )


def _lost(row: Standing) -> str:
    losses = f"{row.lost_episodes} of {row.policies * row.episodes}"
    if row.most_lost_fraction > row.lost_fraction:
        losses += f", most {round(row.most_lost_fraction * row.episodes)} of {row.episodes}"
    return losses


# titles of the columns: figures of a controller, and comparisons
FIGURES = ("law", "RMSE after 3 s", "IQM", "first 3 s", "return", "activity", "at bound", "term")
COMPARED = ("law", "against", "p", "P", "score", "to the")


def table(rows: Sequence[Standing]) -> dict[str, list[str]]:
    """Return the rows as columns of text by their titles: policies as kinds, errors in mm; a star
    marks a controller that reads the truth or a preview.
    """
    rows = shown(rows)
    names = short_names([row.controller for row in rows])
    columns: dict[str, list[str]] = {}
    for row in rows:
        policies = f" ({row.policies})" if row.policies > 1 else ""
        cells = {
            "scenario": row.scenario,
            "law": f"{names[row.controller]}{policies}{'*' if row.uses_truth else ''}",
            **(_by_error(row) if row.ranked_by == SETTLED else _by_return(row)),
            "activity": f"{row.command_activity:.3g}",
            "at bound": f"{100 * row.saturated_fraction:.0f} %",
            "terminated": _lost(row),
            "score": "-" if math.isnan(row.score) else f"{row.score:.2f}",
            "P": f"{row.improvement_over_rival:.2f}",
        }
        if not math.isnan(row.share_of_limit):
            cells["to the limit"] = f"{100 * row.share_of_limit:.0f} %"
        for title, text in cells.items():
            columns.setdefault(title, []).append(text)
    return columns


def _by_error(row: Standing) -> dict[str, str]:
    """Return the cells of a row that is ranked by its error."""
    p = row.p_over_best
    return {
        "RMSE after 3 s (mm), 95 %": in_mm(row.rmse_settled_m, row.rmse_settled_ci95_m),
        "IQM": in_mm(row.iqm_rmse_m),
        "first 3 s": in_mm(row.rmse_transient_m),
        "return": f"{row.return_mean:.1f}",
        f"against {row.rival}, 95 %": _change_text(row.change_over_rival, row.change_ci95),
        "against the best, 95 %": _change_text(row.change_over_best, row.change_over_best_ci95),
        "p": "-" if p is None else f"{p:.3f}",
    }


def _by_return(row: Standing) -> dict[str, str]:
    """Return the cells of a row that is ranked by its return."""
    low, high = row.return_ci95
    return {"return, 95 %": f"{row.return_mean:.4g} ({low:.4g} to {high:.4g})"}


def part_of(columns: dict[str, list[str]], titles: Sequence[str]) -> dict[str, list[str]]:
    """Return the columns whose titles begin with one of ``titles``."""
    return {title: texts for title, texts in columns.items() if title.startswith(tuple(titles))}


def markdown(rows: Sequence[Standing]) -> str:
    """Return the rows as two tables for a page: figures, and comparisons."""
    columns = table(rows)
    titles = ("scenario", *FIGURES), ("scenario", *COMPARED)
    return "\n".join(_markdown(part) for some in titles if (part := part_of(columns, some)))


def _markdown(columns: dict[str, list[str]]) -> str:
    left_aligned = ("scenario", "law", "RMSE", "return, ", "against")
    rule = ["-" if title.startswith(left_aligned) else "-:" for title in columns]
    lines = [list(columns), rule, *zip(*columns.values(), strict=True)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def legend(task: str, rows: Sequence[Standing]) -> str:
    """Return the words below the tables of a leaderboard."""
    flown_task, first = task_of(task), rows[0]
    by_error = first.ranked_by == SETTLED
    ranked = "RMSE after 3 s" if by_error else "return: the task states no error"
    sentences = {
        f"{task}: {first.episodes} paired episodes per scenario, seed {first.seed}.": True,
        f"Ranked by {ranked}.": True,
        "IQM: interquartile mean.": by_error,
        "Activity: mean squared change of the command (largest command: 1).": True,
        f"P: probability of improvement over {flown_task.rival}.": True,
        f"To the limit: {flown_task.rival} 0 %, limit 100 %.": not math.isnan(first.share_of_limit),
        "Score: 0 = hover, 1 = oracle.": "oracle" in flown_task.laws,
        "A terminated episode's rest counts 2.5 m.": any(row.lost_episodes for row in rows),
        "*: reads the truth or a preview.": any(row.uses_truth for row in rows),
    }
    return " ".join(text for text, holds in sentences.items() if holds)


def in_mm(value: float, interval: tuple[float, float] | None = None) -> str:
    """Return metres as mm with three digits."""
    ends = "-".join(_digits(end) for end in interval or ())
    return f"{_digits(value)} ({ends})" if ends else _digits(value)


def _digits(metres: float) -> str:
    size = 1e3 * metres
    return f"{size:.{max(0, min(2, 2 - math.floor(math.log10(max(size, 1e-9)))))}f}"


def _change_text(change: float, interval: tuple[float, float]) -> str:
    return f"{100 * change:+.0f} % ({100 * interval[0]:+.0f} to {100 * interval[1]:+.0f})"
