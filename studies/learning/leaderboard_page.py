"""The page of the leaderboard."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from windwrench.evaluation.leaderboard import Line, Result, Row, aggregate, lines_of, rows_of
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import commit, made_by
from windwrench.studies.learning.leaderboard_pictures import (
    draw_curves,
    draw_intervals,
    draw_profiles,
    draw_tracking,
)
from windwrench.studies.learning.study import Places, entries_of, is_done
from windwrench.training.training_envs import TIERS

__all__ = ["rows_of", "write_page"]

_MAIN = ("base", "fast")


def write_page(
    results: Sequence[Result], plan: Mapping[str, Any], places: Places, path: Path
) -> list[Path]:
    """Write the page and its pictures, in a folder of its name beside it; return the paths.

    Raises:
        InputError: the results do not hold hover, oracle, admittance and ratio.
    """
    lines, rows = lines_of(results, plan), rows_of(results, plan)
    if not rows:
        raise InputError(
            f"{places.results}: holds no scores of hover, oracle, admittance and ratio; "
            "windwrench leaderboard --train --only designed makes them"
        )
    worlds = list(dict.fromkeys(row.world for row in rows))
    scenarios = [w for w in worlds if plan["worlds"][w] == {"scenario": w}]
    folder = path.with_suffix("")
    policies = {
        name: file
        for name in plan["learned"]
        if (file := _middle_policy(rows, name, places)) is not None
    }
    pictures = [folder / f"{name}.png" for name in ("curves", "intervals", "profiles", "tracking")]
    draw_curves(results, lines, pictures[0])
    draw_intervals([row for row in rows if row.world in _MAIN], pictures[1])
    draw_profiles(lines, scenarios, pictures[2])
    draw_tracking(policies, pictures[3])
    parts = [
        _head(plan),
        _answers(rows, lines),
        _tables(rows),
        _overview(rows, lines, plan),
        _aggregates(lines, scenarios),
        _losses(rows),
        _pictures(folder.name),
        _ablations(results, plan),
        _training(results, lines),
        _how(plan, results, places),
        made_by("windwrench leaderboard", [commit()]),
    ]
    write_text("\n\n".join(part for part in parts if part) + "\n", path)
    return [path, *pictures]


def _middle_policy(rows: Sequence[Row], name: str, places: Places) -> Path | None:
    """Return the shipped policy of the seed that is in the middle on the fast scenario."""
    found = [row for row in rows if row.name == name and row.world == "fast"]
    if not found:
        return None
    seeds = sorted(range(found[0].seeds), key=lambda s: found[0].by_seed[s])
    file = places.policies / f"{name}-{seeds[len(seeds) // 2]}.npz"
    return file if file.exists() else None


def _head(plan: Mapping[str, Any]) -> str:
    return f"""# Leaderboard: learned policies against designed controllers

Who holds a quadrotor best in the jet of a moving fan that it knows only by the estimated wrench? Every number below is from the result
files in `docs/results/learning`; `windwrench leaderboard` writes this page from them, and
`windwrench leaderboard --train` does whatever is missing. {plan["episodes"]} paired test episodes a world, on seeds that
neither training nor tuning sees; a lost vehicle's remaining time counts at 2.5 m; every policy flies with the full filter.
The line sac-fast was added once the results of sac and sac-wide on these episodes were known."""


def _get(rows: Sequence[Row], name: str, world: str) -> Row | None:
    return next((row for row in rows if row.name == name and row.world == world), None)


def _percent(value: float) -> str:
    return f"{100 * value:+.0f} %"


def _between(interval: tuple[float, float]) -> str:
    return f"{100 * interval[0]:+.0f} to {100 * interval[1]:+.0f}"


def _answers(rows: Sequence[Row], lines: Sequence[Line]) -> str:
    """State what was asked of the comparison, and whether it holds."""
    asked: list[tuple[str, bool, str]] = []
    for line in lines:
        learner = line.name in ("sac", "sac-wide", "sac-fast")
        if not learner and line.trained_on != "wide":
            continue
        for world, target in (("base", 0.10), ("fast", 0.15)):
            row = _get(rows, line.name, world)
            if row is None:
                continue
            who = f"{line.name} ({line.trained_on}) on {world}"
            lost = f"{who}: nothing lost", row.lost_fraction == 0, f"{row.lost_fraction:.1%} lost"
            if not learner:
                asked.append(lost)
                continue
            asked.append(
                (
                    f"{who}: {target:.0%} or more below the best admittance, interval clear of "
                    f"zero",
                    row.change <= -target and row.change_interval[1] < 0,
                    f"{_percent(row.change)} ({_between(row.change_interval)}), {row.seeds} seeds",
                )
            )
            asked.append(
                (
                    f"{who}: wins at least 80 % of the paired episodes",
                    row.wins >= 0.8,
                    f"{row.wins:.0%}",
                )
            )
            if world == "fast":
                asked.append(
                    (
                        f"{who}: better than the best ratio controller, interval clear of zero",
                        row.ratio_interval[1] < 0,
                        f"{_percent(row.ratio_change)} ({_between(row.ratio_interval)})",
                    )
                )
            if world == "base" or line.name != "sac":
                asked.append(lost)
    if not asked:
        return ""
    table = ["| asked | holds | measured |", "| ----- | ----- | -------- |"]
    table += [
        f"| {what} | {'yes' if holds else '**no**'} | {measured} |"
        for what, holds, measured in asked
    ]
    return "## What was asked\n\nIn parentheses: what it was trained on.\n\n" + "\n".join(table)


def _tables(rows: Sequence[Row]) -> str:
    parts = [
        "## Base and fast",
        "Change: of the mean RMSE against the admittance controller with the gain that is best in that "
        "very world (chosen on the test episodes, which favours the controller), likewise against the "
        "best ratio controller; interval: "
        "paired bootstrap over episodes and seeds. Wins: paired episodes with a smaller RMSE than "
        "that admittance. P: "
        "probability of improvement over it.",
    ]
    for world in _MAIN:
        some = [row for row in rows if row.world == world]
        if not some:
            continue
        parts.append(
            f"### {world}\n\n"
            f"| controller | seeds | RMSE (m), 95 % | median | lost | score | against "
            f"{some[0].rival} | wins | P "
            f"| against {some[0].ratio_rival} |\n| - | - | - | - | - | - | - | - | - | - |\n"
            + "\n".join(
                f"| {r.name} | {r.seeds if r.group != 'designed' else '-'} "
                f"| {r.rmse_m:.3f} ({r.interval[0]:.3f}-{r.interval[1]:.3f}) | {r.median_m:.3f} "
                f"| {r.lost_fraction:.1%} | {r.score:.2f} | {_percent(r.change)} "
                f"({_between(r.change_interval)}) "
                f"| {r.wins:.0%} | {r.improvement:.2f} | {_percent(r.ratio_change)} "
                f"({_between(r.ratio_interval)}) |"
                for r in some
            )
        )
    return "\n\n".join(parts)


def _overview(rows: Sequence[Row], lines: Sequence[Line], plan: Mapping[str, Any]) -> str:
    worlds = list(dict.fromkeys(row.world for row in rows))
    unseen = [
        f"{w} ({'; '.join(plan['worlds'][w]['effects'])})"
        for w in worlds
        if "effects" in plan["worlds"][w]
    ]
    other = [w for w in worlds if "estimator" in plan["worlds"][w]]
    notes = (
        f" No training saw the effects of the true vehicle in {', '.join(unseen)}, and the filter "
        f"does not know them."
        if unseen
        else ""
    )
    notes += "".join(
        f" {w} is {plan['worlds'][w]['scenario']} felt through the "
        f"{plan['worlds'][w]['estimator']} filter."
        for w in other
    )
    table = [
        "| controller | trained on | " + " | ".join(worlds) + " |",
        "| - | - |" + " - |" * len(worlds),
    ]
    best = {
        w: min((r.rmse_m for r in rows if r.world == w and r.name != "oracle"), default=0.0)
        for w in worlds
    }
    for line in lines:
        if line.group == "ablation":
            continue
        cells = []
        for world in worlds:
            row = _get(rows, line.name, world)
            text = "-" if row is None else f"{row.rmse_m:.3f}"
            text = f"**{text}**" if row is not None and row.rmse_m == best[world] else text
            cells.append(
                text
                + (
                    f" ({row.lost_fraction:.1%} lost)"
                    if row is not None and row.lost_fraction > 0
                    else ""
                )
            )
        table.append(f"| {line.name} | {line.trained_on or '-'} | " + " | ".join(cells) + " |")
    return (
        f"""## All worlds

Mean RMSE in m; the best but for the oracle is bold. A policy trained on base flies all other worlds unprepared; wide mixes
{", ".join(dict.fromkeys(TIERS["wide"]))}.{notes}

"""
        + "\n".join(table)
        + "".join(_same_elsewhere(lines, w, plan["worlds"][w]["scenario"]) for w in other)
    )


def _same_elsewhere(lines: Sequence[Line], world: str, scenario: str) -> str:
    """Say by how much the mean RMSE changes between two worlds, over all controllers that flew
    both.
    """
    both = [x for x in lines if x.group != "ablation" and world in x.rmse and scenario in x.rmse]
    if not both:
        return ""
    changes = sorted(float(x.rmse[world].mean() / x.rmse[scenario].mean() - 1) for x in both)
    return (
        f"\n\nFrom {scenario} to {world} the mean RMSE of these {len(both)} controllers changes by "
        f"{100 * changes[0]:+.1f} "
        f"to {100 * changes[-1]:+.1f} %."
    )


def _aggregates(lines: Sequence[Line], worlds: Sequence[str]) -> str:
    found = aggregate(lines, worlds)
    if not found:
        return ""
    return f"""## Over all scenarios

Interquartile mean of the score over the {len(worlds)} scenarios, each between hover (0) and oracle (1), with its stratified
bootstrap interval (Agarwal and others, 2021); for designed controllers the interval is over episodes.

| controller | IQM | 95 % |
| - | - | - |
""" + "\n".join(
        f"| {name} | {iqm:.3f} | {low:.3f}-{high:.3f} |" for name, iqm, (low, high) in found
    )


def _losses(rows: Sequence[Row]) -> str:
    """Say plainly where learning does not win."""
    items = []
    for row in rows:
        if row.group != "learned":
            continue
        worse = []
        if row.change_interval[1] >= 0:
            kind = "worse than" if row.change_interval[0] > 0 else "no clear gain over"
            worse.append(
                f"{kind} {row.rival}: {_percent(row.change)} ({_between(row.change_interval)})"
            )
        if row.ratio_interval[1] >= 0:
            kind = "worse than" if row.ratio_interval[0] > 0 else "no clear gain over"
            worse.append(
                f"{kind} {row.ratio_rival}: {_percent(row.ratio_change)} "
                f"({_between(row.ratio_interval)})"
            )
        if row.lost_fraction > 0:
            worse.append(f"loses {row.lost_fraction:.1%} of the episodes")
        if worse:
            items.append(f"| {row.world} | {row.name} | {'; '.join(worse)} |")
    if not items:
        return "## Where learning does not win\n\nNowhere in these worlds."
    return (
        "## Where learning does not win\n\nEvery world in which a learned policy is not clearly "
        "better than both controllers with "
        "their best gains, or loses a vehicle.\n\n| world | policy | |\n| - | - | - |\n"
        + "\n".join(items)
    )


def _pictures(folder: str) -> str:
    return f"""## Pictures

![Mean RMSE of every controller on base and fast, with intervals and seeds]({folder}/intervals.png)

![RMSE on validation episodes over the course of training]({folder}/curves.png)

![Share of episodes above each score]({folder}/profiles.png)

![One test episode as each controller flies it]({folder}/tracking.png)"""


def _ablations(results: Sequence[Result], plan: Mapping[str, Any]) -> str:
    ablation = plan["ablation"]
    rows = rows_of(results, plan, ablation=True) if ablation else []
    if not rows:
        return ""
    first = {row.world: row for row in rows if row.name == ablation["reference"]}
    worlds = ablation["worlds"]
    table = [
        "| changed | seeds | " + " | ".join(f"RMSE on {w} (m), 95 %" for w in worlds) + " |",
        "| - | - |" + " - |" * len(worlds),
    ]
    for name in [ablation["reference"], *ablation["changes"]]:
        cells, seeds = [], "-"
        for world in worlds:
            row = _get(rows, name, world)
            if row is None:
                cells.append("-")
                continue
            seeds = str(row.seeds)
            gap = ""
            if world in first and name != ablation["reference"]:
                gap = f", {_percent(row.rmse_m / first[world].rmse_m - 1)}"
            cells.append(f"{row.rmse_m:.3f} ({row.interval[0]:.3f}-{row.interval[1]:.3f}){gap}")
        table.append(f"| {name} | {seeds} | " + " | ".join(cells) + " |")
    return (
        f"## What matters\n\nOne thing changed at a time in {ablation['algorithm']} on "
        f"{ablation['scenario']} "
        f"({', '.join(ablation['set'])}); the percentage is against the first row. All are scored "
        f"with the full filter, "
        "and by what each sees.\n\n" + "\n".join(table)
    )


def _training(results: Sequence[Result], lines: Sequence[Line]) -> str:
    table = [
        "| policy | trained on | seeds | decisions | minutes a seed | RMSE on fast by seed (m) |",
        "| - | - | - | - | - | - |",
    ]
    for line in lines:
        runs = [r["training"] for r in results if r["name"] == line.name and "training" in r]
        if line.group != "learned" or not runs:
            continue
        minutes = sorted(t["seconds"] / 60 for t in runs)
        seeds = (
            ", ".join(f"{v:.3f}" for v in line.rmse["fast"].mean(axis=1))
            if "fast" in line.rmse
            else "-"
        )
        table.append(
            f"| {line.name} | {line.trained_on} | {len(runs)} | {runs[0]['steps'][-1]} "
            f"| {minutes[0]:.1f}-{minutes[-1]:.1f} | {seeds} |"
        )
    if len(table) == 2:
        return ""
    return (
        "## Training\n\nMinutes: of one process on a machine that did other work beside it, "
        "validation included. One "
        "decision is 80 ms of flight.\n\n" + "\n".join(table)
    )


def _how(plan: Mapping[str, Any], results: Sequence[Result], places: Places) -> str:
    missing = [e for e in entries_of(plan) if not is_done(e, plan, places)]
    text = """## How

* Seeds of episodes: training below 900 000, validation from there, test from 1 000 000 on. The best of a run's validations,
  not the last, is the policy that is scored.
* The designed controllers' gains are tuned on 60 validation episodes of base, fast and wide (`windwrench tune`); what was found, and the
  command, is in `controllers/tuned.yaml`.
* A policy is a file of weights with a card beside it (`training/policies`) and is flown without a
  deep-learning library: `windwrench benchmark --controllers training/policies/sac-0.npz,admittance --scenarios base,fast`.
* `windwrench train sac --scenario base --seed 0` trains one again. Configurations: `training/configs`."""
    if missing:
        names = dict.fromkeys(e.name for e in missing if e.group != "ablation")
        some = [f"{name} ({sum(e.name == name for e in missing)} seeds)" for name in names]
        ablations = sum(e.group == "ablation" for e in missing)
        some += [f"{ablations} runs of the ablations"] if ablations else []
        text += f"\n\nNot finished: {', '.join(some)}. "
        text += "`windwrench leaderboard --train` goes on with it."
    return text
