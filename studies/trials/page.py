"""The trials of the diagnosis as a compressed JSON file, a page and a picture."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from windwrench import __version__
from windwrench.runtime.page_files import write_json, write_png, write_text
from windwrench.runtime.provenance import commit, made_by
from windwrench.studies.trials.rotorpy_flights import available
from windwrench.studies.trials.scores import (
    COEFFICIENT_BAR,
    FAILED,
    OUTCOMES,
    PARTIAL,
    RIGHT,
    RIGHT_TENTATIVE,
    SILENT,
    TENTATIVE,
    UNEXPLAINED,
    WRONG,
    Judgement,
    doubts,
    judge,
    left_out,
    rules,
    undecided,
)
from windwrench.studies.trials.trials import EQUIVALENTS, stamp
from windwrench.studies.trials.unseen_outsiders import UNSEEN

# how an outcome is drawn: colour, letter and the letter's colour
_LOOK: Mapping[str, tuple[str, str, str]] = {
    RIGHT: ("#1b7837", "R", "white"),
    RIGHT_TENTATIVE: ("#a6dba0", "r", "black"),
    PARTIAL: ("#f6e8a8", "P", "black"),
    TENTATIVE: ("#92c5de", "T", "black"),
    UNEXPLAINED: ("#2166ac", "U", "white"),
    SILENT: ("#dddddd", "S", "black"),
    WRONG: ("#d6402b", "X", "white"),
    FAILED: ("#222222", "F", "white"),
}
_LINES = 520.0  # points, of the names of a column's rows
Cells = Mapping[tuple[str, str], Sequence[str]]  # outcomes by row and column


def write_results(
    outcomes: Sequence[Mapping[str, Any]],
    folder: Path,
    page: Path,
    seeds: int,
    quick: bool,
    first: int = 0,
    groups: Sequence[str] = (),
) -> list[Path]:
    """Write ``trials.json.gz`` and ``trials.png`` into a folder, and the page that shows them;
    return the three paths.

    Args:
        outcomes: of ``trials.run_trials``.
        folder: for the data and the picture.
        page: where the page goes.
        seeds: that were asked for.
        quick: whether it was the short run.
        first: the first of the seeds.
        groups: that were asked for; default: all.

    Raises:
        InputError: a file cannot be written.
    """
    judged = [j for outcome in outcomes for j in judge(outcome)]
    data, picture = folder / "trials.json.gz", folder / "trials.png"
    kept = {
        "version": __version__,
        "commit": commit(),
        "code": stamp(),
        "seed": first,
        "seeds": seeds,
        "quick": quick,
        "rules": [asdict(rule) for rule in rules(judged)],
        "trials": outcomes,
    }
    write_json(kept, data, allow_nan=True)
    write_png(draw(judged), picture)
    command = " ".join(
        [
            f"windwrench trials --seed {first} --seeds {seeds}",
            *["--quick"] * quick,
            *(f"--group '{group}'" if " " in group else f"--group {group}" for group in groups),
        ]
    )
    where = Path(os.path.relpath(folder, page.parent)).as_posix()
    write_text(page_text(outcomes, judged, made_by(command, [commit()]), where), page)
    return [data, picture, page]


# ---- the page
# ------------------------------------------------------------


def page_text(
    outcomes: Sequence[Mapping[str, Any]], judged: Sequence[Judgement], made: str, where: str
) -> str:
    """Return the page, in Markdown, of trials whose files lie in the folder ``where``; ``made``
    says how they came about.
    """
    full = [j for j in judged if not j.without]
    seconds = [j.seconds for j in judged]
    parts = [
        "# Diagnosis trials: simulated flights whose true effects are known",
        "",
        f"How often is a diagnosis right? {len(outcomes)} simulated flights, {len(judged)} "
        "diagnoses. Each flight has one effect, two, none, or a disturbance that the library "
        "does not have. A name is *right* where it is the added effect's, or where the "
        "diagnosis says that these flights cannot distinguish it from the added effect. It "
        "is *confidently wrong* where it is neither, and not marked tentative. [How the "
        "flights were made](#how-the-flights-were-made).",
        "",
        "## Results and targets",
        "",
        *_table(
            ("rule", "target", "measured", "diagnoses", "met"),
            (
                (
                    r.subject,
                    r.target,
                    r.measured,
                    str(r.count),
                    "-" if r.met is None else "yes" if r.met else "**no**",
                )
                for r in rules(judged)
            ),
        ),
        "",
        "## At a glance",
        "",
        f"![Every trial's outcome]({where}/trials.png)",
        "",
        *(f"* **{_LOOK[name][1]}** {name}: {meaning}" for name, meaning in OUTCOMES.items()),
        "",
        "## One effect",
        "",
        "With the whole library. The error is that of the worst coefficient that is not zero in "
        "the "
        "truth, in brackets in its own standard deviations.",
        "",
        *_effect_table([j for j in full if j.group in ("typical", "third", "preset")]),
        "",
        "## Left out of the library",
        "",
        "The same flights, diagnosed with a library that lacks the cause: the right answer is a "
        "tentative name. *The flight "
        "cannot tell* where the whole library, on that flight, says so of the truth and of what is "
        "named here. These leave the "
        "same log as another effect, whatever is flown, and go out together with it: "
        + ", ".join(f"{a} (with {', '.join(b)})" for a, b in EQUIVALENTS.items())
        + ".",
        "",
        *_left_out_table(judged, "typical"),
        "",
        *_left_out_table(judged, "small"),
        "",
        *_alone(judged),
        "## Outside the library",
        "",
        *_plain_table([j for j in full if j.group in ("outsider", "held back")]),
        "",
        "## Two effects",
        "",
        *_plain_table([j for j in full if j.group == "pair"]),
        "",
        "## Hover",
        "",
        *_plain_table([j for j in full if j.group == "hover"]),
        "",
        "## No effect",
        "",
        *_plain_table([j for j in full if j.group in ("nothing", "strong turbulence")]),
        "",
        "## RotorPy's Hummingbird",
        "",
        *_rotorpy([j for j in full if j.group == "rotorpy"]),
        "",
        "## What was missed",
        "",
        *_misses(judged),
        *_not_flown(outcomes),
        "",
        f"A diagnosis took {np.median(seconds or 0):.0f} s in the median and "
        f"{max(seconds, default=0):.0f} s at most.",
        "",
        "## How the flights were made",
        "",
        "* Each is of 60 s, one log, of the declared vehicle and what was added to it. "
        "Signs, sizes (by a factor of 0.8 to 1.25), paths, noise of the pose (half, once or "
        "twice what is declared) and background turbulence (none or weak) are drawn anew for "
        "each. *A third* is a third of the library's typical size.",
        "* One effect is flown on a trajectory on which its worst coefficient is known about "
        "as well as on any.",
        "* Some flights were used while the rules of the diagnosis were made: seeds 0 to 52, "
        "101 to 107, 201 to 203 and 401 to 404; two effects of flights 0 to 229, 690 to "
        "1589, 2000 to 2049 and 3000 to 3049; lags and delays of seeds 500 to 505; hovers of "
        "seeds 510 to 527; disturbances of seeds 600 to 629, but for those that no rule has "
        "seen; and loose gimbals of other axes, sizes and frequencies. No others were.",
        "* *Held-back* disturbances were kept apart until most rules stood. They have been used "
        "since: the diagnosis has rules of its own for five of them (failing_cell, high_hull, "
        "loose_gimbal, winding_cord, passing_wash). No rule comes from the six that were written "
        "last (" + ", ".join(UNSEEN) + "). They were first diagnosed on seed 20, spinning_lidar on "
        "seed 26, tail_fin and panning_camera on seed 44.",
        "",
        made,
        "",
        f"Data: [trials.json.gz]({where}/trials.json.gz).",
        "",
    ]
    return "\n".join(parts)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    body = ["| " + " | ".join(cell.replace("|", "/") for cell in row) + " |" for row in rows]
    return ["| " + " | ".join(head) + " |", "| " + " | ".join("---" for _ in head) + " |", *body]


def _names(j: Judgement) -> str:
    return ", ".join(j.named) or ("-" if not j.problem else f"error: {j.problem}")


def _effect_table(some: Sequence[Judgement]) -> list[str]:
    rows = []
    for j in sorted(some, key=lambda j: (j.cause, j.group != "typical", j.vehicle, j.key)):
        size = "a third" if j.size == "small" else "typical"
        rows.append(
            (
                j.cause,
                size + ("" if j.vehicle == "ardrone2" else f", {j.vehicle}"),
                _flight(j),
                j.outcome,
                _names(j),
                _worst(j),
                f"{j.floor_ratio:.2f}",
                f"{j.rollout_ratio:.2f} ({j.rollout_of_truth:.2f})",
            )
        )
    return _table(
        (
            "added",
            "size",
            "flight",
            "outcome",
            "named",
            "worst coefficient",
            "residual / floor",
            "1 s prediction, after / before (the true model's)",
        ),
        rows,
    )


def _flight(j: Judgement) -> str:
    return j.flight.replace(", typical", "").replace(", small", "")


def _worst(j: Judgement) -> str:
    if not j.errors:
        return "-"
    name, (error, sigmas) = max(j.errors.items(), key=lambda item: item[1][0])
    return f"{name.split('.')[1]} {error:.1%} ({sigmas:.1f})"


def _left_out_table(judged: Sequence[Judgement], size: str) -> list[str]:
    some = [j for j in left_out(judged, size) if j.group != "held back"]
    full = [j for j in judged if not j.without]
    # the whole library's own doubt excuses nothing, but it says that the flight was to blame
    rows = [
        (
            j.cause,
            ", ".join(j.without),
            _flight(j),
            j.outcome
            + (", as the flight cannot tell" if j.outcome == WRONG and undecided(j, full) else ""),
            _names(j),
            j.gave_away or "-",
        )
        for j in sorted(some, key=lambda j: j.key)
    ]
    title = "typical size" if size == "typical" else "a third of it"
    return _table(
        (f"added, {title}", "left out", "flight", "outcome", "named", "what gave it away"), rows
    )


def _alone(judged: Sequence[Judgement]) -> list[str]:
    """Tell what comes of leaving out an effect and leaving in the one that no log
    can tell it from.
    """
    some = [
        j
        for j in judged
        if j.group in ("typical", "third") and j.without == j.truth and j.cause in EQUIVALENTS
    ]
    if not some:
        return []
    rows = ((j.cause, _flight(j), j.outcome, _names(j)) for j in sorted(some, key=lambda j: j.key))
    return [
        "With the equivalent left in, it is named, as it must be; this is not counted in the "
        "rules.",
        "",
        *_table(("added and left out", "flight", "outcome", "named"), rows),
        "",
    ]


def _plain_table(some: Sequence[Judgement]) -> list[str]:
    rows = (
        (
            j.cause + (" (held back)" if j.group == "held back" else ""),
            "a third" if j.size == "small" else "typical",
            _flight(j) + ("" if j.vehicle == "ardrone2" else f", {j.vehicle}"),
            j.outcome,
            j.verdict,
            _names(j),
            j.gave_away or "-",
        )
        for j in some
    )
    return _table(
        ("added", "size", "flight", "outcome", "verdict", "named", "sign of structure"), rows
    )


def _rotorpy(some: Sequence[Judgement]) -> list[str]:
    if not some:
        return [
            "Not flown: RotorPy is not in this run."
            if available()
            else "Not flown: RotorPy is not installed (`pip install rotorpy`)."
        ]
    rows = (
        (
            "on" if j.truth else "off",
            j.flight.split(",")[0],
            j.outcome,
            _names(j),
            ", ".join(f"{c} {e:.1%}" for c, (e, _) in j.errors.items()) or "-",
            f"{j.floor_ratio:.2f}",
            f"{j.rollout_ratio:.2f}",
        )
        for j in some
    )
    return [
        "Another group's dynamics and aerodynamics, 40 s each, declared without aerodynamics.",
        "",
        *_table(
            (
                "aerodynamics",
                "flight",
                "outcome",
                "named",
                "errors of coefficients",
                "residual / floor",
                "1 s prediction, after / before",
            ),
            rows,
        ),
    ]


def _misses(judged: Sequence[Judgement]) -> list[str]:
    counted = {id(j) for size in ("typical", "small") for j in left_out(judged, size)}
    lines = []
    for j in judged:
        what = _miss(j, id(j) in counted)
        if what:
            without = f", without {', '.join(j.without)}" if j.without else ""
            vehicle = "" if j.vehicle == "ardrone2" else f", {j.vehicle}"
            lines.append(f"* {j.cause} ({j.group}, {j.flight}{vehicle}{without}): {what}.")
    return lines or ["Nothing."]


def _miss(j: Judgement, is_left_out: bool) -> str:
    """Return in words how a judgement falls short of the rules; empty where it does not."""
    if j.outcome == FAILED:
        return f"ended in an error: {j.problem}"
    if j.without or j.group == "hover":
        return (
            f"confidently wrong: {_names(j)}"
            if j.outcome == WRONG and (is_left_out or not j.without)
            else ""
        )
    if j.group in ("outsider", "held back"):
        return "" if doubts(j) else f"{j.verdict}: {_names(j)}"
    if j.outcome != RIGHT:
        return f"{j.outcome}: {_names(j)}" + (f" ({j.gave_away})" if j.gave_away else "")
    if j.group in ("typical", "preset", "rotorpy"):
        far = [
            f"{c} by {e:.1%} ({s:.1f} standard deviations)"
            for c, (e, s) in j.errors.items()
            if e > COEFFICIENT_BAR
        ]
        return f"the right name, but off: {', '.join(far)}" if far else ""
    return ""


def _not_flown(outcomes: Iterable[Mapping[str, Any]]) -> list[str]:
    return [f"* {o['key']}: not flown: {o['error']}." for o in outcomes if "error" in o]


# ---- the picture
# ------------------------------------------------------------


def draw(judged: Sequence[Judgement]) -> Figure:
    """Draw every outcome as a cell: effects by what was asked of them, and beside them all other
    flights.
    """
    figure = Figure(figsize=(16.5, 10.5), layout="constrained")
    left, *others = figure.subfigures(1, 3, squeeze=False, width_ratios=(1.25, 0.9, 0.9))[0]
    asked: tuple[tuple[str, Callable[[Judgement], bool]], ...] = (
        ("typical", lambda j: j.group == "typical" and not j.without),
        ("a third", lambda j: j.group == "third" and not j.without),
        ("left out", _is_left_out(judged, "typical")),
        ("left out,\na third", _is_left_out(judged, "small")),
        ("hover", lambda j: j.group == "hover"),
        ("presets", lambda j: j.group == "preset"),
    )
    effects = [j for j in judged if j.group in ("typical", "third", "hover", "preset")]
    _matrix(left.subplots(), "one effect", _cells(effects, asked, lambda j: j.cause))
    sizes: tuple[tuple[str, Callable[[Judgement], bool]], ...] = (
        ("typical", lambda j: j.size == "typical"),
        ("a third", lambda j: j.size == "small"),
    )
    calm: tuple[tuple[str, Callable[[Judgement], bool]], ...] = (
        ("background", lambda j: j.group == "nothing"),
        ("strong\nturbulence", lambda j: j.group == "strong turbulence"),
    )
    panels = (
        [
            (
                "outside the library (* held back)",
                _cells(
                    [j for j in judged if j.group in ("outsider", "held back")],
                    sizes,
                    lambda j: j.cause + ("*" if j.group == "held back" else ""),
                ),
            ),
            (
                "no effect",
                _cells(
                    [j for j in judged if j.group in ("nothing", "strong turbulence")],
                    calm,
                    lambda j: j.flight.split(",")[0],
                ),
            ),
        ],
        [
            (
                "two effects",
                _cells(
                    [j for j in judged if j.group == "pair"],
                    (("typical", lambda j: True),),
                    lambda j: j.cause,
                ),
            ),
            (
                "RotorPy's Hummingbird",
                _cells(
                    [j for j in judged if j.group == "rotorpy"],
                    (("aerodynamics\non", lambda j: bool(j.truth)), ("off", lambda j: not j.truth)),
                    lambda j: j.flight.split(",")[0],
                ),
            ),
        ],
    )
    for part, column in zip(others, panels, strict=True):
        flown = [(title, cells) for title, cells in column if cells]
        if flown:
            heights = [2.0 + len({row for row, _ in cells}) for _, cells in flown]
            axes = part.subplots(len(flown), 1, squeeze=False, height_ratios=heights)[:, 0]
            for axis, (title, cells) in zip(axes, flown, strict=True):
                _matrix(axis, title, cells)
    figure.legend(
        handles=[
            Patch(color=_LOOK[name][0], label=f"{_LOOK[name][1]}: {name}") for name in OUTCOMES
        ],
        loc="outside lower center",
        ncols=len(OUTCOMES),
        fontsize=8,
        frameon=False,
    )
    return figure


def _is_left_out(judged: Sequence[Judgement], size: str) -> Callable[[Judgement], bool]:
    counted = {id(j) for j in left_out(judged, size)}
    return lambda j: id(j) in counted


def _cells(
    some: Sequence[Judgement],
    columns: Sequence[tuple[str, Callable[[Judgement], bool]]],
    row: Callable[[Judgement], str],
) -> dict[tuple[str, str], list[str]]:
    """Return outcomes by row and column, rows by name, columns in the given order."""
    rows = sorted({row(j) for j in some})
    return {
        (name, title): [j.outcome for j in some if row(j) == name and wanted(j)]
        for name in rows
        for title, wanted in columns
    }


def _matrix(axis: Axes, title: str, cells: Cells) -> None:
    rows, columns = (
        list(dict.fromkeys(row for row, _ in cells)),
        list(dict.fromkeys(column for _, column in cells)),
    )
    size = min(8.0, _LINES / max(len(rows), 1))
    for (row, column), outcomes in cells.items():
        x, y = columns.index(column), rows.index(row)
        for i, outcome in enumerate(outcomes):
            colour, letter, ink = _LOOK[outcome]
            width = 0.94 / len(outcomes)
            axis.add_patch(
                Rectangle(
                    (x + 0.03 + i * width, y + 0.05),
                    width,
                    0.9,
                    facecolor=colour,
                    edgecolor="white",
                )
            )
            if len(outcomes) <= 6:
                axis.text(
                    x + 0.03 + (i + 0.5) * width,
                    y + 0.5,
                    letter,
                    color=ink,
                    ha="center",
                    va="center",
                    fontsize=0.9 * size,
                )
    axis.set(xlim=(0, max(len(columns), 1)), ylim=(max(len(rows), 1), 0))
    axis.set_xticks(np.arange(len(columns)) + 0.5, columns, fontsize=8)
    axis.set_yticks(np.arange(len(rows)) + 0.5, rows, fontsize=size)
    axis.xaxis.tick_top()
    axis.tick_params(length=0)
    axis.set_title(title, fontsize=10, loc="left", fontweight="bold")
    for spine in axis.spines.values():
        spine.set_visible(False)
