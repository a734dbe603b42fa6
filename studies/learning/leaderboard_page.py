"""The page of the leaderboard."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from windwrench.controllers.flight_response import half_response
from windwrench.controllers.tuned import tuned_gains
from windwrench.evaluation.statistics import holm
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import commit, made_by
from windwrench.studies.learning.leaderboard_pictures import (
    draw_curves,
    draw_intervals,
    draw_profiles,
    draw_summary,
    draw_tracking,
)
from windwrench.studies.learning.scores import (
    Comparison,
    Line,
    Result,
    Row,
    aggregate,
    best_of,
    compare,
    lines_of,
    rows_of,
)
from windwrench.studies.learning.study import Places, entries_of, is_done
from windwrench.training.training_envs import TIERS

__all__ = ["rows_of", "write_page"]

_MAIN = ("base", "fast")
_LEVEL = 0.05


def write_page(
    results: Sequence[Result], plan: Mapping[str, Any], places: Places, path: Path
) -> list[Path]:
    """Write the page and its pictures, in a folder of its name beside it; return the paths.

    Raises:
        InputError: the results do not hold hover, oracle, admittance and ratio.
    """
    lines, rows = _scored(results, plan, places)
    folder = path.with_suffix("")
    policies = {
        name: file
        for name in plan["learned"]
        if (file := _middle_policy(rows, name, places)) is not None
    }
    pictures = [
        folder / f"{name}.png"
        for name in ("curves", "intervals", "profiles", "tracking", "summary")
    ]
    draw_curves(results, lines, pictures[0])
    draw_intervals([row for row in rows if row.world in _MAIN], pictures[1])
    draw_profiles(lines, _scenarios(rows, plan), pictures[2])
    draw_tracking(policies, pictures[3])
    draw_summary(rows, pictures[4])
    write_text(_text(results, plan, places, folder.name, lines, rows), path)
    return [path, *pictures]


def page_text(
    results: Sequence[Result], plan: Mapping[str, Any], places: Places, folder: str
) -> str:
    """Return the page, in Markdown, whose pictures lie in ``folder``.

    Raises:
        InputError: the results do not hold hover, oracle, admittance and ratio.
    """
    return _text(results, plan, places, folder, *_scored(results, plan, places))


def _text(
    results: Sequence[Result],
    plan: Mapping[str, Any],
    places: Places,
    folder: str,
    lines: list[Line],
    rows: list[Row],
) -> str:
    parts = [
        _head(plan),
        _verdict(rows, lines),
        f"![RMSE of a few controllers on base and fast, with intervals]({folder}/summary.png)",
        _tables(rows),
        _pictures(folder),
        _limit(results, rows, plan),
        _overview(rows, lines, plan),
        _aggregates(lines, _scenarios(rows, plan)),
        _losses(rows),
        _ablations(results, plan),
        _training(results, lines),
        _tuning(),
        _answers(rows, lines),
        _how(plan, results, places),
        made_by("windwrench leaderboard", [commit()]),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _scored(
    results: Sequence[Result], plan: Mapping[str, Any], places: Places
) -> tuple[list[Line], list[Row]]:
    """Return the lines and rows of the results."""
    lines, rows = lines_of(results, plan), rows_of(results, plan)
    if not rows:
        raise InputError(
            f"{places.results}: holds no scores of hover, oracle, admittance and ratio; "
            "windwrench leaderboard --train --only designed makes them"
        )
    return lines, rows


def _scenarios(rows: Sequence[Row], plan: Mapping[str, Any]) -> list[str]:
    """Return the worlds that are plain scenarios."""
    worlds = dict.fromkeys(row.world for row in rows)
    return [world for world in worlds if plan["worlds"][world] == {"scenario": world}]


def _middle_policy(rows: Sequence[Row], name: str, places: Places) -> Path | None:
    """Return the shipped policy of the seed that is in the middle on the fast scenario."""
    found = [row for row in rows if row.name == name and row.world == "fast"]
    if not found:
        return None
    seeds = sorted(range(found[0].seeds), key=lambda s: found[0].by_seed[s])
    file = places.policies / f"{name}-{seeds[len(seeds) // 2]}.npz"
    return file if file.exists() else None


def _head(plan: Mapping[str, Any]) -> str:
    return f"""# Leaderboard: designed controllers and learned policies

Who holds a quadrotor best in the jet of a moving fan, if it knows the fan by the estimated wrench alone? Lower RMSE of the
distance from the fan's axis is better. Each world (a scenario of the task) has {plan["episodes"]} paired test episodes, on seeds that neither training nor
tuning sees. In parentheses: 95 % intervals. [How it was measured](#how)."""


def _get(rows: Sequence[Row], name: str, world: str) -> Row | None:
    return next((row for row in rows if row.name == name and row.world == world), None)


def _percent(value: float) -> str:
    return f"{100 * value:+.0f} %"


def _between(interval: tuple[float, float]) -> str:
    return f"{100 * interval[0]:+.0f} to {100 * interval[1]:+.0f}"


def _said(one: Comparison) -> str:
    return f"{_percent(one.change)} ({_between(one.interval)})"


def _against_informed(name: str, lines: Sequence[Line], world: str) -> Comparison | None:
    """Compare a policy with the best tracker that knows the family of motions, as whoever learned
    from these motions does, too.
    """
    line = next(x for x in lines if x.name == name)
    rival = best_of(lines, "tracker-informed", world)
    return None if rival is None else compare(line.rmse[world], rival, world)


def _verdict(rows: Sequence[Row], lines: Sequence[Line]) -> str:
    """Say first what learning loses to."""
    sentences = []
    for world in _MAIN:
        some = [row for row in rows if row.world == world]
        learned = [row for row in some if row.group == "learned"]
        if not learned or any("tracker" not in row.against for row in learned):
            continue
        best = learned[0]
        lead, tracker = best.against["lead"], best.against["tracker"]
        beaten = sum(row.against["tracker"].interval[0] > 0 for row in learned)
        ahead = sum(row.against["tracker"].interval[1] < 0 for row in learned)
        even = (
            "no clear difference"
            if lead.interval[0] <= 0 <= lead.interval[1]
            else ("better" if lead.change < 0 else "worse")
        )
        text = (
            f"* **{world}**: {beaten} of {len(learned)} kinds of learned policies are clearly worse than the tracker "
            f"`{tracker.rival}`, which knows nothing of how the fan moves; {ahead} clearly better. The best of them is {best.name} "
            f"({best.rmse_m:.3f} m). Its RMSE is {_said(tracker)} against that tracker, and {_said(lead)} against `{lead.rival}`, "
            f"a law of three numbers: {even}."
        )
        informed = [row for row in some if row.name.startswith("tracker-informed")]
        one = _against_informed(best.name, lines, world)
        if informed and one is not None:
            text += (
                f" A tracker that knows the family of motions reaches {informed[0].rmse_m:.3f} m, "
                f"{_said(informed[0].against['tracker'])} against the one that does not. The policy {best.name} "
                f"was trained on motions of that family, and is {_said(one)} against it."
            )
        sentences.append(text)
    if not sentences:
        return ""
    return "## Who wins\n\n" + "\n".join([_target(rows), *sentences])


def _target(rows: Sequence[Row]) -> str:
    """Say whether each policy of a kind is at or below the tracker in both worlds and loses nothing,
    of the kind that comes closest.
    """
    kinds: dict[str, list[Row]] = {}
    for world in _MAIN:
        for row in rows:
            if row.world == world and row.group == "learned":
                kinds.setdefault(row.name, []).append(row)

    def below(row: Row) -> int:
        rival = _get(rows, row.against["tracker"].rival, row.world)
        return 0 if rival is None else sum(seed <= rival.rmse_m for seed in row.by_seed)

    def lost(row: Row) -> int:
        return round(row.lost_fraction * row.seeds * row.episodes)

    def holds(name: str) -> bool:
        return all(below(row) == row.seeds and not lost(row) for row in kinds[name])

    name = max(kinds, key=lambda kind: (min(map(below, kinds[kind])), -sum(map(lost, kinds[kind]))))
    told = "; ".join(
        f"on {row.world} {below(row)} of {row.seeds}, {lost(row)} of {row.seeds * row.episodes} "
        "episodes lost"
        for row in kinds[name]
    )
    return (
        f"* **Target of learning: {'reached' if holds(name) else 'missed'}.** Asked was a kind of policy that loses nothing. Each of its "
        f"seeds was to have a mean RMSE at or below that of the best tracker that does not know the motions, on base and on fast. "
        f"Closest comes {name}: {told}."
    )


def _answers(rows: Sequence[Row], lines: Sequence[Line]) -> str:
    """State the targets of the comparison, and which were met."""
    asked: list[tuple[str, bool, str, float | None]] = []
    for line in lines:
        learner = line.name in ("sac", "sac-wide", "sac-fast")
        memory = line.name.startswith("recurrent-imitation")
        if line.group != "learned" or not (learner or memory or line.trained_on == "wide"):
            continue
        for world, target in (("base", 0.10), ("fast", 0.15)):
            row = _get(rows, line.name, world)
            if row is None:
                continue
            who = f"{line.name} ({line.trained_on}) on {world}"
            for law in ("tracker", "lead"):
                if law in row.against:
                    one = row.against[law]
                    what = f"{who}: better than the best {law} ({one.rival})"
                    asked.append((what, one.change < 0, _said(one), one.p))
            informed = _against_informed(line.name, lines, world) if memory else None
            if informed is not None:
                what = f"{who}: better than the best tracker that knows the motions"
                told = f"{what} ({informed.rival})"
                asked.append((told, informed.change < 0, _said(informed), informed.p))
            if learner:
                one = row.against["admittance"]
                what = f"{who}: {target:.0%} or more below the best admittance"
                asked.append((what, one.change <= -target, _said(one), one.p))
                what = f"{who}: wins at least 80 % of the paired episodes against it"
                asked.append((what, one.wins >= 0.8, f"{one.wins:.0%}", None))
                if world == "fast":
                    one = row.against["ratio"]
                    what = f"{who}: better than the best ratio controller"
                    asked.append((what, one.change < 0, _said(one), one.p))
            if not learner or world == "base" or line.name != "sac":
                lost = f"{row.lost_fraction:.1%} lost"
                asked.append((f"{who}: nothing lost", row.lost_fraction == 0, lost, None))
    if not asked:
        return ""
    tested = {n: one[3] for n, one in enumerate(asked) if one[3] is not None}
    corrected = dict(zip(tested, holm(list(tested.values())), strict=True))
    table = ["| target | met | measured | p, corrected |", "| ----- | ----- | -------- | - |"]
    answers = []
    for n, (what, holds, measured, _) in enumerate(asked):
        holds = holds and corrected.get(n, 0.0) < _LEVEL
        p = f"{corrected[n]:.3f}" if n in corrected else "-"
        answers.append((holds, f"| {what} | {'yes' if holds else '**no**'} | {measured} | {p} |"))
    table += [line for holds, line in sorted(answers, key=lambda one: one[0])]
    return (
        "## Targets of learning\n\nThose that were missed stand first. In parentheses: what it was "
        f"trained on. A comparison is met only if its p-value, corrected for all {len(tested)} "
        "comparisons of this table (Holm), is below 0.05 as well.\n\n" + "\n".join(table)
    )


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.0%}"


def _lost(row: Row) -> str:
    low, high = row.lost_interval
    return f"{row.lost_fraction:.1%} ({100 * low:.1f}-{100 * high:.1f})"


def _tables(rows: Sequence[Row]) -> str:
    parts = [
        "## Base and fast",
        "*Against* a law: the change of the mean RMSE. The law has the gains that are best in this "
        "world, chosen on the test episodes, which favours it. *Wins*: share of the paired episodes "
        "with a smaller RMSE than the best admittance law. *P*: probability of improvement over "
        "that law. *To the limit*: share of the way from the untuned admittance law to `limit`, "
        "which knows all that the wrench can tell.",
    ]
    for world in _MAIN:
        some = [row for row in rows if row.world == world]
        if not some:
            continue
        laws = list(some[0].against)
        against = " | ".join(f"against {some[0].against[law].rival}" for law in laws)
        lines = []
        for r in some:
            first = r.against["admittance"]
            changes = " | ".join(_said(r.against[law]) for law in laws)
            low, high = first.improvement_interval
            lines.append(
                f"| {r.name} | {r.seeds if r.group != 'designed' else '-'} "
                f"| {r.rmse_m:.3f} ({r.interval[0]:.3f}-{r.interval[1]:.3f}) | {r.median_m:.3f} "
                f"| {_lost(r)} | {r.score:.2f} | {_share(r.share)} | {first.wins:.0%} "
                f"| {first.improvement:.2f} ({low:.2f}-{high:.2f}) | {changes} |"
            )
        parts.append(
            f"### {world}\n\n"
            f"| controller | policies | RMSE (m) | median | lost | score | to the limit | wins | P "
            f"| {against} |\n|" + " - |" * (9 + len(laws)) + "\n" + "\n".join(lines)
        )
    return "\n\n".join(parts)


def _limit(results: Sequence[Result], rows: Sequence[Row], plan: Mapping[str, Any]) -> str:
    """Say what the best controller could reach, flown and bounded."""
    found = next((r for r in results if r["name"] == "limit"), None)
    if found is None:
        return ""
    table = [
        "| world | best tracker | best learned | limit, flown | lower bound | oracle |",
        "| - | - | - | - | - | - |",
    ]
    for world in dict.fromkeys(row.world for row in rows):
        bounds = found["scores"].get(world, {}).get("bound_m")
        flown, oracle = _get(rows, "limit", world), _get(rows, "oracle", world)
        if not bounds or flown is None or oracle is None:
            continue
        learned = [r for r in rows if r.world == world and r.group == "learned"]
        best = f"{learned[0].name} {learned[0].rmse_m:.3f}" if learned else "-"
        tracker = flown.against.get("tracker")
        own = _get(rows, tracker.rival, world) if tracker is not None else None
        table.append(
            f"| {world} | {'-' if own is None else f'{own.rmse_m:.3f}'} | {best} "
            f"| {flown.rmse_m:.3f} ({flown.interval[0]:.3f}-{flown.interval[1]:.3f}) "
            f"| {np.mean(bounds[: plan['episodes']]):.3f} | {oracle.rmse_m:.3f} |"
        )
    if len(table) == 2:
        return ""
    return f"""## The limit

What could the best controller reach that sees the estimated wrench and not the fan? `limit` is a particle filter with the model by
which episodes are made: motions with their ranges, jet, gusts, disturbance, noise of the pose and the filter's own lag. The lower bound
is how uncertain even it is of where the fan will be {half_response():.2f} s later, after which the flight loop has carried out half of a command.
It is the root mean square over an episode of the posterior's standard deviation, mean over the episodes, in m. It leaves out that
gusts move the vehicle, too; the gap from there to the oracle is what the wrench does not tell, and no learning can find it there. What
varied draws anew in each episode and undeclared effects are not in the model of `limit`: there it is a controller and no limit.

""" + "\n".join(table)


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
        w: min(
            (r.rmse_m for r in rows if r.world == w and r.name not in ("oracle", "limit")),
            default=0.0,
        )
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

Mean RMSE in m; the best but for the oracle and the limit is bold. A policy trained on base flies all other worlds unprepared; wide mixes
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

Mean of the score over all episodes of the {len(worlds)} scenarios, each between hover (0) and oracle (1), with what is lost among them;
nothing is left out. Beside it the interquartile mean (Agarwal and others, 2021), which looks at the middle half of the episodes and so
does not see a lost one.

| controller | policies | score | lost | middle half |
| - | - | - | - | - |
""" + "\n".join(
        f"| {one.name} | {one.seeds} | {one.score:.3f} ({one.interval[0]:.3f}-{one.interval[1]:.3f}) "
        f"| {one.lost:.1%} ({100 * one.lost_interval[0]:.1f}-{100 * one.lost_interval[1]:.1f}) "
        f"| {one.middle:.3f} ({one.middle_interval[0]:.3f}-{one.middle_interval[1]:.3f}) |"
        for one in found
    )


def _losses(rows: Sequence[Row]) -> str:
    """Say plainly where learning does not win."""
    items = []
    for row in rows:
        if row.group != "learned":
            continue
        worse = []
        for one in row.against.values():
            if one.interval[1] >= 0:
                kind = "worse than" if one.interval[0] > 0 else "no clear gain over"
                worse.append(f"{kind} {one.rival}: {_said(one)}")
        if row.lost_fraction > 0:
            worse.append(f"loses {row.lost_fraction:.1%} of the episodes")
        if worse:
            items.append(f"| {row.world} | {row.name} | {'; '.join(worse)} |")
    if not items:
        return "## Where learning does not win\n\nNowhere in these worlds."
    return (
        "## Where learning does not win\n\nEvery world in which a learned policy is not clearly "
        "better than every kind of designed law with its best gains, or loses a vehicle.\n\n"
        "| world | policy | |\n| - | - | - |\n" + "\n".join(items)
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


def _tuning() -> str:
    """State what the search of each law's gains cost."""
    table = [
        "| law | tuned on | gains | sets tried | episodes each | decisions at most "
        "| RMSE found, before (m) |",
        "| - | - | - | - | - | - | - |",
    ]
    for law, scenarios in tuned_gains().items():
        for scenario, found in scenarios.items():
            gains = ", ".join(f"{name} {value:g}" for name, value in found["gains"].items())
            table.append(
                f"| {law} | {scenario} | {gains} | {found['trials']} | {found['episodes']} "
                f"| {found['trials'] * found['episodes'] * 250} "
                f"| {found['rmse_m']:.3f}, {found['default_rmse_m']:.3f} |"
            )
    return (
        "## Tuning\n\nWhat designed laws were given, to set beside the decisions of training: gains "
        "searched on validation episodes (`windwrench train tune`). A set of gains that is far behind "
        "after ten episodes is given up. Before: the gains that the search began with.\n\n"
        + "\n".join(table)
    )


def _how(plan: Mapping[str, Any], results: Sequence[Result], places: Places) -> str:
    missing = [e for e in entries_of(plan) if not is_done(e, plan, places)]
    text = """## How

* Every number is from the result files in `docs/results/learning`. `windwrench leaderboard` writes this page from them, and
  `windwrench leaderboard --train` does whatever is missing.
* Every controller flies with the full filter. A lost vehicle's remaining time counts at 2.5 m.
* Intervals are over policies and episodes (hierarchical bootstrap): both are drawn anew, a policy with all its episodes and an episode for
  all policies. A designed controller is one policy, so episodes alone vary.
* The lines sac-fast and recurrent-imitation, and all trackers and laws with lead, were added once results on these episodes were known. The
  gains of these laws come from validation episodes alone.
* Seeds of episodes: training below 900 000, validation from there, test from 1 000 000 on. The best of a run's validations,
  not the last, is the policy that is scored.
* The designed controllers' gains are tuned on 60 validation episodes (`windwrench train tune`); what was found, and the
  command, is in `controllers/tuned.yaml`.
* A policy is a file of weights with a card beside it (`training/policies`) and is flown without a
  deep-learning library: `windwrench benchmark --controllers sac-0,tracker,admittance --scenarios base,fast`.
* `windwrench train sac --scenario base --seed 0` trains one again. Configurations: `training/configs`."""
    if missing:
        names = dict.fromkeys(e.name for e in missing if e.group != "ablation")
        some = [f"{name} ({sum(e.name == name for e in missing)} seeds)" for name in names]
        ablations = sum(e.group == "ablation" for e in missing)
        some += [f"{ablations} runs of the ablations"] if ablations else []
        text += f"\n\nNot finished: {', '.join(some)}. "
        text += "`windwrench leaderboard --train` goes on with it."
    return text
