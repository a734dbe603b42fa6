"""The ``windwrench`` command."""

import os
import shlex
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Column, Table

from .dynamics.errors import InputError

app = typer.Typer(
    name="windwrench", no_args_is_help=True, add_completion=True, rich_markup_mode=None, pretty_exceptions_enable=False,
    help="A quadrotor that feels the wind: fly it in a fan's jet, benchmark controllers, estimate the wrench on a flight log.",
)
console = Console()
_errors = Console(stderr=True)
_UsageError: Any = typer.BadParameter.__base__  # an option or argument that typer cannot use

Out = Annotated[Path, typer.Option("--out", help="Folder for the results; it is made if need be.")]
VehicleOption = Annotated[str, typer.Option("--vehicle", help="Preset (ardrone2, crazyflie, hummingbird) or a YAML file.")]


def _folder(out: Path) -> Path:
    """Make the results' folder before the work starts, so that no result is lost for want of it."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be made a folder: {error.strerror or error}") from error
    if not os.access(out, os.W_OK):
        raise InputError(f"--out {out}: is not writable")
    return out


def _progress() -> Progress:
    return Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
                    console=_errors, transient=True)


@app.command()
def fly(
    scenario: Annotated[str, typer.Option(help="static, base, fast, slow-filter, noisy, gusty, far or varied.")] = "base",
    controller: Annotated[str, typer.Option(help="hover, admittance, ratio or oracle.")] = "admittance",
    seed: Annotated[int, typer.Option(min=0, help="Of the episode.")] = 0,
    vehicle: VehicleOption = "ardrone2",
    effect: Annotated[list[str] | None, typer.Option(help="Undeclared effect NAME:coef=value of the true vehicle.")] = None,
    video: Annotated[bool, typer.Option("--video", help="Also write fly.mp4 and its last frame (video extra).")] = False,
    view: Annotated[bool, typer.Option("--view", help="Show it in a window while it flies.")] = False,
    out: Out = Path("results/fly"),
) -> None:
    """Fly one episode in the jet; write a picture of it.

    Example: windwrench fly --scenario static --controller admittance --video
    """
    from .controllers import make_controller
    from .dynamics.effects import parse_setting
    from .envs.fan_tracking import FanTrackingEnv
    from .training.evaluate import DECISIONS, fly_episode
    from .training.pictures import draw_episode

    if video:
        from .envs.video import VideoWriter
    pilot = make_controller(controller)
    mode = "rgb_array" if video else "human" if view else None
    env = FanTrackingEnv(scenario, mode, vehicle, [parse_setting(e) for e in effect or []], width=960, height=640)
    folder = _folder(out)
    with _progress() as progress:
        task = progress.add_task("flying", total=DECISIONS)
        if video:
            with VideoWriter(folder / "fly.mp4", env) as writer:
                def each() -> None:
                    writer.add()
                    progress.advance(task)

                episode = fly_episode(env, pilot, seed, each)
        else:
            episode = fly_episode(env, pilot, seed, lambda: progress.advance(task))
    env.close()
    draw_episode(episode, f"{controller}, {scenario}", folder / "fly.png")
    table = Table("controller", "scenario", "fan", "RMSE (m)", "lost", "reward", box=box.SIMPLE_HEAD)
    table.add_row(controller, scenario, episode.motion, f"{episode.rmse:.3f}", "yes" if episode.lost else "no",
                  f"{episode.total_reward:.1f}")
    console.print(table)
    _say(folder / "fly.png", *([folder / "fly.mp4", folder / "fly.scene.png"] if video else []))


@app.command()
def benchmark(
    controllers: Annotated[str, typer.Option(help="Names, with commas.")] = "hover,admittance,ratio,oracle",
    scenarios: Annotated[str, typer.Option(help="Names, with commas.")] = "static,base",
    episodes: Annotated[int, typer.Option(min=1, help="Paired episodes a scenario.")] = 40,
    seed: Annotated[int, typer.Option(min=0, help="Of the benchmark.")] = 0,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core.")] = None,
    out: Out = Path("results/benchmark"),
) -> None:
    """Fly controllers through the same episodes; write the leaderboard.

    Example: windwrench benchmark --controllers hover,admittance,oracle --scenarios base,fast --episodes 40
    """
    from .training.benchmark import check_request, count_flights, fly_all, leaderboard, write_leaderboard
    from .training.pictures import draw_leaderboard

    names, worlds = _names(controllers, "--controllers"), _names(scenarios, "--scenarios")
    check_request(names, worlds, episodes, seed)
    folder = _folder(out)
    with _progress() as progress:
        task = progress.add_task("flying episodes", total=count_flights(names, worlds, episodes))
        results = fly_all(names, worlds, episodes, seed, jobs, lambda count: progress.advance(task, count))
    rows = leaderboard(results, names, seed)
    path = write_leaderboard(rows, folder)
    draw_leaderboard(rows, results, folder / "leaderboard.png")
    table = Table("scenario", "controller", "RMSE (m), 95 %", "median", "lost", "score", "wins*", box=box.SIMPLE_HEAD)
    for i, row in enumerate(rows):
        low, high = row.rmse_ci95_m
        last = i + 1 == len(rows) or rows[i + 1].scenario != row.scenario
        table.add_row(row.scenario, row.controller, f"{row.rmse_m:.3f} ({low:.3f}-{high:.3f})",
                      f"{row.median_rmse_m:.3f}", f"{row.lost_fraction:.1%}", f"{row.score:.2f}",
                      f"{row.wins_over_admittance:.1%}", end_section=last)
    console.print(table)
    console.print(f"{episodes} paired episodes a scenario, seed {seed}; score: 0 = hover, 1 = oracle; *over admittance",
                  highlight=False)
    _say(path, folder / "leaderboard.png")


@app.command()
def estimate(
    log: Annotated[Path, typer.Argument(help="Flight log: .csv, .csv.gz or .parquet.")],
    reader: Annotated[str | None, typer.Option(help="For a log of another form: nanobench, crazyswarm2, px4_ulog, rosbag "
                                                    "or rosbag:TOPICS.yaml.")] = None,
    vehicle: VehicleOption = "ardrone2",
    out: Out = Path("results/estimate"),
) -> None:
    """Estimate the external wrench on a logged flight; write wrench.csv and a picture.

    Example: windwrench estimate flight.csv --reader nanobench --vehicle crazyflie
    """
    from .dynamics.vehicle_file import load_vehicle
    from .identification.estimate import estimate_log, plot_wrench, truth_rmse, write_wrench
    from .identification.flight_log import read_log

    model = load_vehicle(vehicle)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the notes say the same
        flight = read_log(log, reader, model)
    folder = _folder(out)
    with console.status("estimating"):
        series = estimate_log(flight, model)
    path = write_wrench(series, folder)
    picture = plot_wrench(series, flight, folder / "wrench.png")
    for note in dict.fromkeys((*flight.notes, *series.notes)):
        _errors.print(note, style="yellow" if note.startswith("warning") else "dim", highlight=False, markup=False)
    console.print(f"{flight.name}: {len(flight.t)} samples, {flight.t[-1] - flight.t[0]:.1f} s", highlight=False)
    table = Table("", "x", "y", "z", box=box.SIMPLE_HEAD)
    for name, values, unit in (("force", series.force, "N"), ("torque", series.torque, "Nm")):
        table.add_row(f"{name}, mean ({unit})", *(f"{v:+.4g}" for v in values.mean(axis=0)))
        table.add_row(f"{name}, std ({unit})", *(f"{v:.4g}" for v in values.std(axis=0)))
    truth = truth_rmse(series, flight)
    if truth is not None:
        for name, error, unit in (("force", truth[0], "N"), ("torque", truth[1], "Nm")):
            table.add_row(f"{name}, RMSE to truth ({unit})", *(f"{v:.4g}" for v in error))
    console.print(table)
    _say(path, picture)


@app.command()
def diagnose(
    logs: Annotated[list[Path], typer.Argument(help="Flight logs of one vehicle: .csv, .csv.gz or .parquet.")],
    test: Annotated[list[Path] | None, typer.Option(help="Log on which alone the error is reported; may be repeated.")] = None,
    reader: Annotated[str | None, typer.Option(help="For logs of another form: nanobench, crazyswarm2, px4_ulog, rosbag or "
                                                    "rosbag:TOPICS.yaml.")] = None,
    without: Annotated[list[str] | None, typer.Option(help="Effect to take out of the library; may be repeated.")] = None,
    vehicle: VehicleOption = "ardrone2",
    out: Out = Path("results/diagnose"),
) -> None:
    """Find the physical effects that a vehicle's model lacks; write report.json, report.html and vehicle.yaml.

    Example: windwrench diagnose flight.csv --vehicle my_drone.yaml --out results/my_drone
    """
    from .dynamics.vehicle_file import load_vehicle
    from .identification.diagnosis import diagnose as run
    from .identification.flight_log import read_log
    from .identification.report import write_report
    from .identification.report_words import error_sentences, headline, remainder_sentence

    model = load_vehicle(vehicle)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the notes say the same
        flights = [read_log(path, reader, model) for path in logs]
        unseen = [read_log(path, reader, model) for path in test or []]
    folder = _folder(out)
    with console.status("looking at the logs") as status:
        found = run(flights, model, unseen, without or (), lambda text: status.update(text))
    for note in found.notes:
        _errors.print(note, style="dim", highlight=False, markup=False)
    for sentence in (headline(found), *error_sentences(found), remainder_sentence(found)):
        console.print(sentence, highlight=False, markup=False)
    if found.effects:
        table = Table("effect", "coefficient", "value", "+-", "unit", box=box.SIMPLE_HEAD)
        for effect in found.effects:
            for i, (name, value) in enumerate(effect.coefficients.items()):
                title = effect.name + (" (tentative)" if effect.tentative else "") if i == 0 else ""
                table.add_row(title, name, f"{value:.4g}", f"{effect.std[name]:.2g}", effect.units[name])
        console.print(table)
    table = Table("held-out", "before", "after", "floor", box=box.SIMPLE_HEAD)
    before, after = found.before, found.after
    table.add_row("force (N)", f"{before.force_rms:.3g}", f"{after.force_rms:.3g}", f"{found.floor_force_rms:.3g}")
    table.add_row("torque (Nm)", f"{before.torque_rms:.3g}", f"{after.torque_rms:.3g}", f"{found.floor_torque_rms:.3g}")
    table.add_row("1 s prediction (m)", f"{before.rollout_1s_position_rms:.3g}", f"{after.rollout_1s_position_rms:.3g}", "")
    console.print(table)
    for line in found.advice:
        console.print(line, highlight=False, markup=False)
    _say(*write_report(found, folder, shlex.join(["windwrench", *sys.argv[1:]])))


@app.command()
def record(
    out: Annotated[Path, typer.Option("--out", help="The log: .csv, .csv.gz or .parquet.")] = Path("results/flight.csv"),
    vehicle: VehicleOption = "ardrone2",
    effect: Annotated[list[str] | None, typer.Option(help="Undeclared effect, NAME or NAME:coef=value,...")] = None,
    trajectory: Annotated[
        str, typer.Option(help="hover, gentle, excite, ground, yaw, circle, ceiling, vertical, fast or jet.")] = "excite",
    seconds: Annotated[float, typer.Option(help="Length of the flight.")] = 60.0,
    seed: Annotated[int, typer.Option(min=0)] = 0,
) -> None:
    """Fly a vehicle with effects that it does not declare; write a flight log.

    Example: windwrench record --effect rotor_drag:kdx=1.2e-4,kdy=1.2e-4 --trajectory excite --out drag.csv
    """
    from .dynamics.effects import parse_setting
    from .dynamics.vehicle_file import load_vehicle
    from .envs.recording import record_flight
    from .identification.files import file_kind
    from .identification.flight_log import FlightLog, write_log

    model = load_vehicle(vehicle)
    effects = tuple(parse_setting(e, model) for e in effect or [])
    file_kind(out)
    with console.status(f"flying {seconds:g} s"):
        columns = record_flight(model, effects, trajectory, seconds, seed)
    log = FlightLog(columns["t"], columns["position"], columns["quaternion"], columns["rotor_speeds"],
                    columns.get("voltage"), columns["force"], columns["torque"], name=out.stem)
    write_log(log, out)
    console.print(f"{len(columns['t'])} samples of {trajectory} by {model.name} with "
                  f"{', '.join(e.name for e in effects) or 'no undeclared effect'}", highlight=False)
    _say(out)


@app.command()
def reproduce(
    figure: Annotated[str, typer.Argument(help="fig3, fig4, fig5, fig6, fig7, extension or all.")] = "all",
    out: Out = Path("results/reproduction"),
    seeds: Annotated[int | None, typer.Option(min=1, help="For every figure; default: each one's own number.")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core.")] = None,
    page: Annotated[Path | None, typer.Option(help="Where to write the page; default: reproduction.md in the folder.")] = None,
) -> None:
    """Reproduce the paper's figures; what a run has finished, the next does not repeat.

    Example: windwrench reproduce fig6 --out results/reproduction
    """
    import json

    from .experiments import NAMES
    from .experiments.reproduce import chosen, write_page
    from .experiments.reproduce import reproduce as run

    names = chosen(figure)
    folder = _folder(out)
    columns = (TextColumn("{task.description:10}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeRemainingColumn())
    with Progress(*columns, console=_errors, transient=True) as progress:
        tasks = {name: progress.add_task(name, total=1.0) for name in names}

        def report(shares: Mapping[str, float]) -> None:
            for name, share in shares.items():
                progress.update(tasks[name], completed=share)

        fresh = run(names, folder, seeds, jobs, report)
    target = folder / "reproduction.md" if page is None else page
    write_page(NAMES, folder, target)
    for name in names:
        kept = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
        console.print(f"\n{kept['title']}" + ("" if fresh[name] else " (kept from before)"), style="bold", highlight=False)
        for row in kept["comparison"]:
            paper = f"; the paper: {row['paper']}" if row["paper"] != "-" else ""
            console.print(f"  {row['quantity']}: {row['here']}{paper}", highlight=False, markup=False)
    _say(*(folder / f"{name}.png" for name in names), target)


@app.command()
def trials(
    seeds: Annotated[int, typer.Option(min=1, help="How often everything is flown, each time anew.")] = 1,
    quick: Annotated[bool, typer.Option("--quick", help="A part of it only, some minutes long.")] = False,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core.")] = None,
    markdown: Annotated[Path | None, typer.Option(help="Where to write the page; default: trials.md in the folder.")] = None,
    out: Out = Path("results/trials"),
) -> None:
    """Diagnose flights whose cause is known, and score it; what a run has finished, the next does not repeat.

    Example: windwrench trials --quick --out results/trials
    """
    from .experiments.diagnosis_scores import judge, rules
    from .experiments.diagnosis_trials import plan, run_trials
    from .experiments.diagnosis_trials_page import write_results

    wanted = plan(seeds, quick)
    folder = _folder(out)
    with _progress() as progress:
        task = progress.add_task("diagnosing flights", total=len(wanted))
        outcomes = run_trials(wanted, folder, jobs, lambda done: progress.update(task, completed=done))
    paths = write_results(outcomes, folder, folder / "trials.md" if markdown is None else markdown, seeds, quick)
    for rule in rules(j for outcome in outcomes for j in judge(outcome)):
        met = {True: "met", False: "not met", None: "-"}[rule.met]
        console.print(f"{met:8}{rule.subject}: {rule.measured}; target: {rule.target}", highlight=False, markup=False,
                      soft_wrap=True)
    _say(*paths)


@app.command()
def speed(
    rounds: Annotated[int, typer.Option(min=1, help="Over which medians are taken.")] = 7,
    markdown: Annotated[Path | None, typer.Option(help="Also write the run as a page.")] = None,
) -> None:
    """Measure a filter step, flights against real time, and start-up, beside peers that are installed.

    Example: windwrench speed --rounds 7
    """
    from .benchmarks.speed import HEADER, filters, flights, measure, rows_of, starts, write_markdown

    with _progress() as progress:
        task = progress.add_task("measuring", total=None)
        contenders = [*filters(), *flights(), *starts()]
        progress.update(task, total=rounds * len(contenders))
        figures = measure(contenders, rounds, lambda: progress.advance(task))
    table = Table(*HEADER[:-1], box=box.SIMPLE_HEAD)
    for row in rows_of(figures):
        table.add_row(*row[:-1])
    console.print(table)
    if markdown is not None:
        write_markdown(figures, rounds, markdown)
        _say(markdown)


@app.command("real-flights")
def real_flights(
    data: Annotated[Path, typer.Option("--data", help="Folder with nanobench/ and crazyswarm2_payload/csv/.")],
    markdown: Annotated[Path, typer.Option(help="The page; pictures and numbers go to a folder of its name beside it.")] = Path(
        "results/real-flights.md"),
) -> None:
    """Diagnose measured flights, each judged on flights that the fit never saw, and write the page.

    Example: windwrench real-flights --data ../shared/data --markdown docs/real-flights.md
    """
    from .dynamics.files import replaced
    from .experiments.real_flights import page, run

    folder = _folder(markdown.with_suffix(""))
    with console.status("diagnosing") as status:
        result = run(folder, data / "nanobench", data / "crazyswarm2_payload" / "csv", status.update)
    with replaced(markdown) as partial:
        partial.write_text(page(result, folder.name), encoding="utf-8")
    _say(folder / "real_flights.json", folder / "nanobench.png", markdown)


@app.command()
def effects(
    markdown: Annotated[Path | None, typer.Option(help="Write the page of all effects to this file instead.")] = None,
) -> None:
    """List the physical effects that plant and estimator know.

    Example: windwrench effects --markdown docs/effects.md
    """
    from .dynamics.effects import get, names

    if markdown is not None:
        from .dynamics.effect_page import effects_page
        from .dynamics.files import replaced

        with replaced(markdown) as partial:
            partial.write_text(effects_page(), encoding="utf-8")
        _say(markdown)
        return
    name_column, coefficient_column = Column("effect", no_wrap=True), Column("coefficient", no_wrap=True)
    table = Table(name_column, "kind", coefficient_column, "unit", "typical, 0.45 / 0.03 kg", "meaning", box=box.SIMPLE_HEAD)
    for name in names():
        one = get(name)
        for i, c in enumerate(one.coefficients):
            table.add_row(name if i == 0 else "", one.kind if i == 0 else "", c.name, c.unit,
                          f"{c.typical[0]:g} / {c.typical[1]:g}", c.meaning, end_section=i + 1 == len(one.coefficients))
    console.print(table)


@app.command("close-loop")
def close_loop(
    effect: Annotated[list[str] | None, typer.Option(help="Effect, NAME or NAME:coef=value,...; again for more. Default: ten "
                                                          "of typical size.")] = None,
    vehicle: VehicleOption = "ardrone2",
    episodes: Annotated[int, typer.Option(min=1, help="Paired episodes an effect and model.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of flights and episodes.")] = 0,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core.")] = None,
    markdown: Annotated[Path | None, typer.Option(help="Also write the results as a page.")] = None,
    out: Out = Path("results/close-loop"),
) -> None:
    """Fly an undeclared effect, name it from the log, declare it, and follow the fan before and after.

    What a run has finished, the next does not repeat.

    Example: windwrench close-loop --effect com_offset --effect mass:dm=0.06 --episodes 20
    """
    from .dynamics.effects import parse_setting
    from .dynamics.vehicle_file import load_vehicle
    from .experiments.close_loop import DEFAULT_EFFECTS, MEASURES, Request, check_requests, close_loops
    from .experiments.close_loop_page import conclusions, write_page
    from .experiments.close_loop_picture import write_picture

    model = load_vehicle(vehicle)
    requests = [Request(parse_setting(e, model), model, episodes, seed) for e in effect or DEFAULT_EFFECTS]
    check_requests(requests)
    folder = _folder(out)
    columns = (TextColumn("{task.description:18}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeRemainingColumn())
    with Progress(*columns, console=_errors, transient=True) as progress:
        tasks = {r.name: progress.add_task(r.name, total=1.0) for r in requests}

        def report(shares: Mapping[str, float]) -> None:
            for name, share in shares.items():
                progress.update(tasks[name], completed=share)

        results = close_loops(requests, folder, jobs, report)
    picture = write_picture(results, folder)
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
    if markdown is not None:
        write_page(results, folder, markdown)
    _say(picture, *(folder / f"{r['name']}.json" for r in results), *([markdown] if markdown else []))


def _names(text: str, option: str) -> list[str]:
    names = [part.strip() for part in text.split(",") if part.strip()]
    if not names:
        raise InputError(f"{option}: expected names with commas between them, got {text!r}")
    return list(dict.fromkeys(names))


def _say(*paths: Path) -> None:
    for path in paths:
        console.print(f"wrote {path}", highlight=False, soft_wrap=True, markup=False)


def main() -> None:
    """Run the command; a user's mistake ends in one clear line and exit code 2."""
    try:
        sys.exit(app(sys.argv[1:] or ["--help"], standalone_mode=False))
    except (InputError, _UsageError) as error:
        text = str(error) if isinstance(error, InputError) else error.format_message()
        _errors.print(f"error: {text}", style="red", highlight=False, soft_wrap=True, markup=False)
        sys.exit(2)
    except (KeyboardInterrupt, typer.Abort):
        _errors.print("interrupted")
        sys.exit(130)
