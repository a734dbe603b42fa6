"""Studies: runs of many flights that write a page."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.table import Column, Table

from .running import expensive
from .terminal import (
    Out,
    VehicleOption,
    console,
    effect_names,
    offering,
    progress_bar,
    results_folder,
    say,
    share_bars,
    working,
)


@expensive
def reproduce(
    figure: Annotated[str, typer.Argument(help="fig3, fig4, fig5, fig6, fig7, extension or all.")] = "all",
    out: Out = Path("results/reproduction"),
    seeds: Annotated[int | None, typer.Option(min=1, help="For every figure; default: each one's own number.")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core.")] = None,
    page: Annotated[Path | None, typer.Option(help="Where to write the page; default: reproduction.md in the folder.")] = None,
) -> dict[str, Any]:
    """Reproduce the paper's figures; what a run has finished, the next does not repeat.

    Example: windwrench reproduce fig6 --out results/reproduction
    """
    import json

    from ..experiments import NAMES
    from ..experiments.reproduce import chosen, is_done, numbers_of_seeds, write_page
    from ..experiments.reproduce import reproduce as run

    names = chosen(figure)
    numbers = numbers_of_seeds(names, seeds)
    folder = results_folder(out, seeds={name: n for name, n in numbers.items() if not is_done(out, name, n)},
                            kept=[name for name, n in numbers.items() if is_done(out, name, n)], jobs=jobs)
    with share_bars() as progress:
        tasks = {name: progress.add_task(name, total=1.0) for name in names}

        def report(shares: Mapping[str, float]) -> None:
            for name, share in shares.items():
                progress.update(tasks[name], completed=share)

        fresh = run(names, folder, seeds, jobs, report)
    target = folder / "reproduction.md" if page is None else page
    write_page(NAMES, folder, target)
    result: dict[str, Any] = {}
    for name in names:
        kept = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
        result[name] = {"title": kept["title"], "figures": kept["figures"], "comparison": kept["comparison"],
                        "kept": not fresh[name]}
        console.print(f"\n{kept['title']}" + ("" if fresh[name] else " (kept from before)"), style="bold", highlight=False)
        for row in kept["comparison"]:
            paper = f"; the paper: {row['paper']}" if row["paper"] != "-" else ""
            console.print(f"  {row['quantity']}: {row['here']}{paper}", highlight=False, markup=False)
    say(*(folder / f"{name}.png" for name in names), target)
    return result


@expensive
def trials(
    seeds: Annotated[int, typer.Option(min=1, help="How often everything is flown, each time anew.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="The first seed.")] = 0,
    quick: Annotated[bool, typer.Option("--quick", help="A part of it only, some minutes long.")] = False,
    group: Annotated[list[str] | None, typer.Option(help="Fly this group alone, such as pair; again for more.")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core.")] = None,
    markdown: Annotated[Path | None, typer.Option(help="Where to write the page; default: trials.md in the folder.")] = None,
    out: Out = Path("results/trials"),
) -> dict[str, Any]:
    """Diagnose flights whose cause is known, and score it; what a run has finished, the next does not repeat.

    Example: windwrench trials --quick --out results/trials
    """
    from ..experiments.diagnosis_scores import judge, rules
    from ..experiments.diagnosis_trials import plan, run_trials
    from ..experiments.diagnosis_trials_page import write_results

    wanted = plan(seeds, quick, seed, group or ())
    folder = results_folder(out, flights=len(wanted), diagnoses=sum(len(trial.libraries) for trial in wanted), jobs=jobs)
    with progress_bar() as progress:
        task = progress.add_task("diagnosing flights", total=len(wanted))
        outcomes = run_trials(wanted, folder, jobs, lambda done: progress.update(task, completed=done))
    paths = write_results(outcomes, folder, folder / "trials.md" if markdown is None else markdown, seeds, quick, seed,
                          group or ())
    measured = rules(j for outcome in outcomes for j in judge(outcome))
    for rule in measured:
        met = {True: "met", False: "not met", None: "-"}[rule.met]
        console.print(f"{met:8}{rule.subject}: {rule.measured}; target: {rule.target}", highlight=False, markup=False,
                      soft_wrap=True)
    say(*paths)
    return {"rules": measured}


@expensive
def real_flights(
    data: Annotated[Path, typer.Option("--data", help="Folder with nanobench/ and crazyswarm2_payload/csv/.")],
    markdown: Annotated[Path, typer.Option(help="The page; pictures and numbers go to a folder of its name beside it.")] = Path(
        "results/real-flights.md"),
) -> dict[str, Any]:
    """Diagnose measured flights, each judged on flights that the fit never saw, and write the page.

    Example: windwrench real-flights --data ../shared/data --markdown docs/real-flights.md
    """
    from ..dynamics.files import replaced
    from ..experiments.real_flights import page, plan, run

    sources = data / "nanobench", data / "crazyswarm2_payload" / "csv"
    folder = results_folder(markdown.with_suffix(""), **plan(*sources))
    with working("diagnosing") as progress:
        result: dict[str, Any] = run(folder, *sources, progress)
    with replaced(markdown) as partial:
        partial.write_text(page(result, folder.name), encoding="utf-8")
    say(folder / "real_flights.json", folder / "nanobench.png", markdown)
    return result


@expensive
def close_loop(
    effect: Annotated[list[str] | None, typer.Option(
        help="Effect, NAME or NAME:coef=value,...; again for more. Default: ten of typical size.",
        autocompletion=offering(effect_names))] = None,
    vehicle: VehicleOption = "ardrone2",
    episodes: Annotated[int, typer.Option(min=1, help="Paired episodes an effect and model.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of flights and episodes.")] = 0,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core.")] = None,
    markdown: Annotated[Path | None, typer.Option(help="Also write the results as a page.")] = None,
    out: Out = Path("results/close-loop"),
) -> dict[str, Any]:
    """Fly an undeclared effect, name it from the log, declare it, and follow the fan before and after.

    What a run has finished, the next does not repeat.

    Example: windwrench close-loop --effect com_offset --effect mass:dm=0.06 --episodes 20
    """
    from ..dynamics.effects import parse_setting
    from ..dynamics.vehicle_file import load_vehicle
    from ..experiments.close_loop import DEFAULT_EFFECTS, MEASURES, Request, check_requests, close_loops
    from ..experiments.close_loop_page import conclusions, write_page
    from ..experiments.close_loop_picture import write_picture

    model = load_vehicle(vehicle)
    requests = [Request(parse_setting(e, model), model, episodes, seed) for e in effect or DEFAULT_EFFECTS]
    check_requests(requests)
    folder = results_folder(out, effects=[r.name for r in requests], episodes=2 * episodes * len(requests), jobs=jobs)
    with share_bars() as progress:
        tasks = {r.name: progress.add_task(r.name, total=1.0) for r in requests}

        def report(shares: Mapping[str, float]) -> None:
            for name, share in shares.items():
                progress.update(tasks[name], completed=share)

        results = close_loops(requests, folder, jobs, report)
    picture = write_picture(results, folder)
    if markdown is not None:
        write_page(results, folder, markdown)
    table = Table(Column("added", no_wrap=True), "named", *(m.title for m in MEASURES), box=box.SIMPLE_HEAD)
    for r in results:
        ratios = [r["summary"][m.key] for m in MEASURES]
        found = [e["name"] for e in r["diagnosis"]["effects"]]
        table.add_row(r["name"], "the same" if found == [r["request"]["effect"]] else ", ".join(found) or "nothing",
                      *(f"x{s['ratio']:.2f}\n{s['ratio_ci95'][0]:.2f}-{s['ratio_ci95'][1]:.2f}" for s in ratios))
    console.print(table)
    console.print(f"after by before (95 %), {episodes} paired episodes an effect, seed {seed}", highlight=False)
    for sentence in conclusions(results):
        console.print(sentence.replace("**", ""), highlight=False, markup=False)
    say(picture, *(folder / f"{r['name']}.json" for r in results), *([markdown] if markdown else []))
    return {r["name"]: {"summary": r["summary"], "diagnosis": r["diagnosis"]} for r in results}
