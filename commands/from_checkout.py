"""Studies: runs of many flights that write a page of this repository. They run from a checkout
alone.
"""

import functools
import os
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

import typer
from rich import box
from rich.table import Column, Table

from ..runtime.errors import InputError
from .running import expensive
from .terminal import (
    Out,
    VehicleOption,
    console,
    effect_names,
    names_in,
    offering,
    progress_bar,
    results_folder,
    say,
    share_bars,
    working,
)

Work = TypeVar("Work", bound=Callable[..., Any])


def has_studies() -> bool:
    """Return whether this is a checkout, which has the studies; an installed wheel has none."""
    return find_spec("windwrench.studies") is not None


def from_a_checkout(work: Work) -> Work:
    """Mark a command that needs the studies: elsewhere it ends in one line that says where to find
    them.
    """

    @functools.wraps(work)
    def checked(**options: Any) -> Any:
        if not has_studies():
            raise InputError(
                f"{work.__name__.replace('_', '-')}: expected a checkout of windwrench's "
                f"repository, whose pages this "
                "command writes; an installed package has no studies"
            )
        return work(**options)

    return cast(Work, checked)


@expensive
@from_a_checkout
def trials(
    seeds: Annotated[
        int, typer.Option(min=1, help="Number of seeds: every flight is flown once with each.")
    ] = 1,
    seed: Annotated[int, typer.Option(min=0, help="First random seed.")] = 0,
    quick: Annotated[
        bool, typer.Option("--quick", help="Fly a subset only (takes minutes).")
    ] = False,
    group: Annotated[
        list[str] | None,
        typer.Option(help="Group of flights to run, such as pair; may be repeated."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Number of processes; default: one per core.")
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(help="Markdown file for the page; default: trials.md in the folder."),
    ] = None,
    out: Out = Path("results/trials"),
) -> dict[str, Any]:
    """Diagnose flights with known effects. Simulate the flights and score the diagnoses; a repeated
    command resumes.

    Example: windwrench trials --quick --out results/trials
    """
    from ..studies.trials.page import write_results
    from ..studies.trials.scores import judge, rules
    from ..studies.trials.trials import plan, run_trials

    wanted = plan(seeds, quick, seed, group or ())
    folder = results_folder(
        out, flights=len(wanted), diagnoses=sum(len(trial.libraries) for trial in wanted), jobs=jobs
    )
    with progress_bar() as progress:
        task = progress.add_task("diagnosing flights", total=len(wanted))
        outcomes = run_trials(
            wanted, folder, jobs, lambda done: progress.update(task, completed=done)
        )
    paths = write_results(
        outcomes,
        folder,
        folder / "trials.md" if markdown is None else markdown,
        seeds,
        quick,
        seed,
        group or (),
    )
    measured = rules(j for outcome in outcomes for j in judge(outcome))
    for rule in measured:
        met = {True: "met", False: "not met", None: "-"}[rule.met]
        console.print(
            f"{met:8}{rule.subject}: {rule.measured}; target: {rule.target}",
            highlight=False,
            markup=False,
            soft_wrap=True,
        )
    say(*paths)
    return {"rules": measured}


@expensive
@from_a_checkout
def real_flights(
    data: Annotated[
        Path,
        typer.Option(
            "--data", help="Data folder that holds nanobench/ and crazyswarm2_payload/csv/."
        ),
    ],
    markdown: Annotated[
        Path,
        typer.Option(
            help="Markdown file for the page; its pictures and numbers go to a folder of its name "
            "beside it."
        ),
    ] = Path("results/real-flights.md"),
) -> dict[str, Any]:
    """Diagnose measured flights. Test each on flights left out of its fit, and write the page.

    Example: windwrench real-flights --data ../shared/data --markdown docs/real-flights.md
    """
    from ..runtime.whole_files import replaced
    from ..studies.measured_flights.measured_flights import page, plan, run

    sources = data / "nanobench", data / "crazyswarm2_payload" / "csv"
    parts: dict[str, Any] = plan(*sources)
    folder = results_folder(markdown.with_suffix(""), **parts)
    with working("diagnosing") as progress:
        result: dict[str, Any] = run(folder, *sources, progress)
    with replaced(markdown) as partial:
        partial.write_text(page(result, folder.name), encoding="utf-8")
    say(folder / "real_flights.json", folder / "nanobench.png", markdown)
    return result


@expensive
@from_a_checkout
def close_loop(
    effect: Annotated[
        list[str] | None,
        typer.Option(
            help="Effect, NAME or NAME:coef=value,...; may be repeated. Default: ten effects of "
            "typical size.",
            autocompletion=offering(effect_names),
        ),
    ] = None,
    vehicle: VehicleOption = "ardrone2",
    episodes: Annotated[
        int, typer.Option(min=1, help="Number of paired episodes per effect and model.")
    ] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Random seed.")] = 0,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Number of processes; default: one per core.")
    ] = None,
    markdown: Annotated[Path | None, typer.Option(help="Markdown file for the results.")] = None,
    out: Out = Path("results/close-loop"),
) -> dict[str, Any]:
    """Compare tracking before and after diagnosis. Fly with an undeclared effect, diagnose the log,
    and declare what was found.

    A repeated command resumes and keeps what is finished.

    Example: windwrench close-loop --effect com_offset --effect mass:dm=0.06 --episodes 20
    """
    from ..dynamics.effects import parse_setting
    from ..dynamics.vehicle_file import load_vehicle
    from ..studies.closed_loop.closed_loop import (
        DEFAULT_EFFECTS,
        MEASURES,
        Request,
        check_requests,
        close_loops,
    )
    from ..studies.closed_loop.page import conclusions, write_page
    from ..studies.closed_loop.picture import write_picture

    model = load_vehicle(vehicle)
    requests = [
        Request(parse_setting(e, model), model, episodes, seed) for e in effect or DEFAULT_EFFECTS
    ]
    check_requests(requests)
    folder = results_folder(
        out, effects=[r.name for r in requests], episodes=2 * episodes * len(requests), jobs=jobs
    )
    with share_bars() as progress:
        tasks = {r.name: progress.add_task(r.name, total=1.0) for r in requests}

        def report(shares: Mapping[str, float]) -> None:
            for name, share in shares.items():
                progress.update(tasks[name], completed=share)

        results = close_loops(requests, folder, jobs, report)
    picture = write_picture(results, folder)
    if markdown is not None:
        write_page(results, folder, markdown)
    table = Table(
        Column("added", no_wrap=True), "named", *(m.title for m in MEASURES), box=box.SIMPLE_HEAD
    )
    for r in results:
        ratios = [r["summary"][m.key] for m in MEASURES]
        found = [e["name"] for e in r["diagnosis"]["effects"]]
        table.add_row(
            r["name"],
            "the same" if found == [r["request"]["effect"]] else ", ".join(found) or "nothing",
            *(
                f"x{s['ratio']:.2f}\n{s['ratio_ci95'][0]:.2f}-{s['ratio_ci95'][1]:.2f}"
                for s in ratios
            ),
        )
    console.print(table)
    console.print(
        f"ratio after / before (95 % interval), {episodes} paired episodes per effect, seed {seed}",
        highlight=False,
    )
    for sentence in conclusions(results):
        console.print(sentence.replace("**", ""), highlight=False, markup=False)
    say(
        picture, *(folder / f"{r['name']}.json" for r in results), *([markdown] if markdown else [])
    )
    return {r["name"]: {"summary": r["summary"], "diagnosis": r["diagnosis"]} for r in results}


@expensive
@from_a_checkout
def leaderboard(
    train: Annotated[
        bool,
        typer.Option("--train", help="Also train and score what is missing."),
    ] = False,
    only: Annotated[
        str,
        typer.Option(
            help="Parts of the study, comma-separated: designed, learned, ablation, or names of "
            "entries."
        ),
    ] = "",
    plan: Annotated[
        Path | None,
        typer.Option(help="Plan of the study (YAML); default: studies/learning/study.yaml."),
    ] = None,
    results: Annotated[
        Path, typer.Option(help="Folder of the result files, one per entry and seed.")
    ] = Path("docs/results/learning"),
    policies: Annotated[Path, typer.Option(help="Folder for the trained policies.")] = Path(
        "training/policies"
    ),
    markdown: Annotated[
        Path | None,
        typer.Option(
            help="Markdown file for the page; its pictures go to a folder of its name beside it."
        ),
    ] = Path("docs/leaderboard.md"),
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Number of processes; default: one per core.")
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", help="Folder for training runs and their checkpoints.")
    ] = Path("results/leaderboard"),
) -> dict[str, Any]:
    """Write the leaderboard page. From its result files; with --train, first train and score what
    is missing.

    A repeated command keeps what is finished, and an interrupted training run resumes.

    Example: windwrench leaderboard --train --only sac,sac-wide
    """
    from ..studies.learning.study import (
        Places,
        entries_of,
        is_done,
        load_plan,
        read_results,
        run_study,
    )

    study = load_plan(plan)
    wanted = entries_of(study, names_in(only, "--only") if only else ())
    places = Places(out, results, policies)
    missing = [e.file for e in wanted if not is_done(e, study, places)]
    folder = results_folder(
        out, lines=len(wanted), missing=missing if train else "left alone (no --train)"
    )
    for one in (places.results, places.policies):
        results_folder(one)
    results_folder(folder)
    if train:
        from ..runtime.extras import need

        need("stable_baselines3", "rl")
        need("sb3_contrib", "rl")
        with share_bars() as bars:
            total = bars.add_task("all", total=max(len(missing), 1))
            tasks: dict[str, Any] = {}

            def report(shares: dict[str, tuple[str, float]], done: int) -> None:
                bars.update(total, completed=done)
                for name in [n for n in tasks if n not in shares]:
                    bars.remove_task(tasks.pop(name))
                for name, (text, share) in shares.items():
                    if name not in tasks:
                        tasks[name] = bars.add_task(text, total=1.0)
                    bars.update(tasks[name], completed=share, description=text)

            run_study(wanted, study, places, jobs or os.cpu_count() or 1, report)
    found = read_results(places)
    if markdown is None:
        return {"lines": len(found), "missing": missing}
    from ..studies.learning.leaderboard_page import rows_of, write_page

    written = write_page(found, study, places, markdown)
    table = Table(
        "world",
        "controller",
        "RMSE (m)",
        "95 %",
        "lost",
        "against the best admittance",
        box=box.SIMPLE_HEAD,
    )
    shown = {name: one for name, one in study["worlds"].items() if name in ("base", "fast")}
    for row in rows_of(found, {**study, "worlds": shown}):
        table.add_row(
            row.world,
            row.name,
            f"{row.rmse_m:.3f}",
            f"{row.interval[0]:.3f}-{row.interval[1]:.3f}",
            f"{row.lost_fraction:.1%}",
            f"{row.against['admittance'].change:+.0%}",
        )
    console.print(table)
    say(*written)
    return {
        "lines": len(found),
        "missing": [e.file for e in wanted if not is_done(e, study, places)],
    }
