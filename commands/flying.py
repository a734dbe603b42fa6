"""Simulated flights: one episode of a task, or the log of a flight."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ..runtime.errors import InputError
from .terminal import (
    CONTROLLERS,
    SCENARIOS,
    VEHICLES,
    EffectOption,
    FilmSeconds,
    Out,
    RrdOption,
    SeedOption,
    TaskOption,
    VehicleOption,
    VideoOption,
    ViewOption,
    console,
    results_folder,
    run,
    say,
    show_table,
    working,
)


def fly(
    task: TaskOption = "FanTracking",
    scenario: Annotated[
        str,
        typer.Option(
            help="Scenario: static, base, fast, slow-filter, noisy, gusty, far or varied; of a "
            "wind task base, turbulent and so on (docs/tasks.md).",
            autocompletion=SCENARIOS,
        ),
    ] = "base",
    controller: Annotated[
        str | None,
        typer.Option(
            help="Controller; default: admittance, or pid-force in the wind. Others: lead, "
            "tracker, sac-0 ..., the path of a trained policy, or FILE.py:CLASS.",
            autocompletion=CONTROLLERS,
        ),
    ] = None,
    seed: SeedOption = 0,
    vehicle: VehicleOption = "ardrone2",
    truth: Annotated[
        str | None,
        typer.Option(
            help="Simulated vehicle, where it is another than the model of --vehicle: an amended "
            "model flies the vehicle that it was made for.",
            autocompletion=VEHICLES,
        ),
    ] = None,
    effect: EffectOption = None,
    video: VideoOption = False,
    gif: Annotated[
        bool, typer.Option("--gif", help="Also write an animation, fly.gif, and its last frame.")
    ] = False,
    film_seconds: FilmSeconds = 20.0,
    rrd: RrdOption = False,
    csv: Annotated[
        bool,
        typer.Option("--csv", help="Also write the flight's time series, fly.csv."),
    ] = False,
    view: ViewOption = False,
    out: Out = Path("results/fly"),
) -> dict[str, Any]:
    """Fly one episode in the jet or in the wind. Write a picture of it.

    Example: windwrench fly --scenario static --controller admittance --gif
    """
    from ..dynamics.effects import parse_setting
    from ..envs.fan_tracking import EPISODE_SECONDS
    from ..envs.video import FPS
    from ..evaluation.benchmark import check_request
    from ..evaluation.episodes import fly_episode, loop_of, time_series
    from ..evaluation.pictures import draw_episode
    from ..evaluation.tasks import make_pilot, short_names, task_of
    from .filming import SIZE, Tally, caption_of, films, written

    kinds = [kind for kind, wanted in (("mp4", video), ("gif", gif)) if wanted]
    effects = [parse_setting(e) for e in effect or []]
    if view and kinds:
        raise InputError(
            "--view shows the flight in a window; expected it without --video and --gif"
        )
    known = task_of(task)
    controller = controller or known.flown
    check_request([controller], [scenario], 1, 0, task)
    env = known.environment(
        scenario,
        "rgb_array" if kinds else "human" if view else None,
        vehicle,
        effects,
        truth=truth,
        width=SIZE[0],
        height=SIZE[1],
    )
    folder = results_folder(out)
    shown = short_names([controller])[controller]
    title = f"{task}, {scenario}: {shown}"
    rate = known.decisions / EPISODE_SECONDS
    every = max(1, round(rate / FPS))
    tally = Tally()
    with (
        working("flying", known.decisions) as progress,
        films(folder, "fly", kinds, film_seconds, every, rate) as film,
    ):

        def each(info: dict[str, Any]) -> None:
            progress(more=1)
            if kinds:
                tally.add(info)
                film(env.render, lambda: caption_of(loop_of(env), env.viewer, title, info, tally))

        episode = fly_episode(env, make_pilot(controller, task), seed, each, known.decisions)
    env.close()
    paths = [folder / "fly.png", *written(folder, "fly", kinds)]
    draw_episode(episode, title, paths[0])
    if csv:
        from ..identification.logs.tables import write_csv

        write_csv(time_series(episode), folder / "fly.csv")
        paths.append(folder / "fly.csv")
    if rrd:
        from ..envs.replay import Flight
        from ..envs.rerun_export import write_rrd

        flight = Flight(
            episode.time,
            episode.position,
            episode.quaternion,
            episode.estimate[:, :3],
            episode.estimate[:, 3:],
            episode.force,
            episode.torque,
            episode.fan_y if episode.in_jet else None,
        )
        write_rrd(flight, env.truth, folder / "fly.rrd")
        paths.append(folder / "fly.rrd")
    columns = {
        "controller": shown,
        "scenario": scenario,
        "motion": episode.motion,
        "RMSE (m)": f"{episode.rmse:.3f}",
        "lost": "yes" if episode.lost else "no",
        "reward": f"{episode.total_reward:.1f}",
    }
    show_table(tuple(columns), [tuple(columns.values())])
    say(*paths)
    return {
        "task": task,
        "controller": controller,
        "scenario": scenario,
        "motion": episode.motion,
        "rmse_m": episode.rmse,
        "lost": episode.lost,
        "reward": episode.total_reward,
    }


def record(
    out: Annotated[
        Path, typer.Option("--out", help="Flight log to write: .csv, .csv.gz or .parquet.")
    ] = Path("results/flight.csv"),
    vehicle: VehicleOption = "ardrone2",
    effect: EffectOption = None,
    trajectory: Annotated[
        str,
        typer.Option(
            help="Trajectory: hover, gentle, excite, ground, yaw, circle, ceiling, vertical, fast, "
            "shake or jet."
        ),
    ] = "excite",
    seconds: Annotated[float, typer.Option(help="Duration of the flight, s.")] = 60.0,
    seed: SeedOption = 0,
) -> dict[str, Any]:
    """Simulate a flight and write its log. The vehicle may have effects that its model does not
    declare.

    Example: windwrench record --effect rotor_drag:kdx=1.2e-4,kdy=1.2e-4 --trajectory excite --out
    drag.csv
    """
    from ..dynamics.effects import parse_setting
    from ..dynamics.vehicle_file import load_vehicle, preset_names
    from ..envs.recording import record_flight
    from ..identification.logs.flight_log import FlightLog, log_name, write_log
    from ..identification.logs.tables import file_kind

    model = load_vehicle(vehicle)
    effects = tuple(parse_setting(e, model) for e in effect or [])
    file_kind(out)
    with working(f"flying {seconds:g} s") as progress:
        columns = record_flight(model, effects, trajectory, seconds, seed, report=progress)
    log = FlightLog(
        columns["t"],
        columns["position"],
        columns["quaternion"],
        columns["rotor_speeds"],
        columns.get("voltage"),
        columns["force"],
        columns["torque"],
        name=out.stem,
        # a file's vehicle may differ from the preset of its name
        vehicle=model.name
        if vehicle in (known := preset_names()) or model.name not in known
        else "",
    )
    write_log(log, out)
    run.record = out.with_name(f"{log_name(out)}.run.json")
    console.print(
        f"{len(columns['t'])} samples of {trajectory} by {model.name} with "
        f"{', '.join(e.name for e in effects) or 'no undeclared effect'}",
    )
    say(out)
    return {
        "samples": len(log.t),
        "vehicle": model.name,
        "trajectory": trajectory,
        "effects": {e.name: dict(e.coefficients) for e in effects},
    }
