"""Simulated flights: one episode of a task, or the log of a flight."""

from pathlib import Path
from typing import Any

from .terminal import (
    console,
    film_kinds,
    result_file,
    results_folder,
    run,
    say,
    show_table,
    working,
)


def fly(
    task: str = "FanTracking",
    scenario: str = "base",
    controller: str | None = None,
    seed: int = 4,  # of FanTracking a fan that moves; that of 0 stands still
    vehicle: str = "ardrone2",
    truth: str | None = None,
    effect: list[str] | None = None,
    video: bool = False,
    gif: bool = False,
    film_seconds: float = 20.0,
    rrd: bool = False,
    csv: bool = False,
    view: bool = False,
    out: Path = Path("results/fly"),
) -> dict[str, Any]:
    """Fly one episode in the jet or in the wind. Write a picture of it.

    Example: windwrench fly --scenario static --controller admittance --gif
    """
    from ..dynamics.effects import parse_setting
    from ..envs.fan_tracking import EPISODE_SECONDS
    from ..envs.video import FPS
    from ..evaluation.benchmark import check_request
    from ..evaluation.episodes import fly_episode, time_series
    from ..evaluation.pictures import draw_episode
    from ..evaluation.tasks import make_pilot, short_names, task_of
    from .filming import SIZE, caption_of, films

    kinds = film_kinds(view, video, gif)
    effects = [parse_setting(e) for e in effect or []]
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
    flown: list[dict[str, Any]] = []
    with (
        working("flying", known.decisions) as progress,
        films(folder, "fly", kinds, film_seconds, every, rate) as (film, filmed),
    ):

        def each(info: dict[str, Any]) -> None:
            progress(more=1)
            if kinds:
                flown.append(dict(info))
                film(env.render, lambda: caption_of(env.loop, env.viewer, title, flown))

        episode = fly_episode(env, make_pilot(controller, task), seed, each, known.decisions)
    env.close()
    paths = [folder / "fly.png", *filmed]
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
    rmse, reward = f"{episode.rmse:.3f}", f"{episode.total_reward:.1f}"
    lost = "yes" if episode.lost else "no"
    show_table(
        ("controller", "scenario", "motion", "RMSE (m)", "lost", "reward"),
        [(shown, scenario, episode.motion, rmse, lost, reward)],
    )
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
    out: Path = Path("results/flight.csv"),
    vehicle: str = "ardrone2",
    effect: list[str] | None = None,
    trajectory: str = "excite",
    seconds: float = 60.0,
    seed: int = 0,
) -> dict[str, Any]:
    """Simulate a flight and write its log. The vehicle may have effects that its model does not
    declare.

    Example: windwrench record --effect rotor_drag:kdx=1.2e-4,kdy=1.2e-4 --trajectory excite --out
    drag.csv
    """
    from ..dynamics.effects import parse_setting
    from ..dynamics.vehicle_file import load_vehicle, name_in_log
    from ..envs.recording import record_flight
    from ..identification.logs.flight_log import FlightLog, write_log
    from ..identification.logs.table import file_kind, stem

    model = load_vehicle(vehicle)
    effects = tuple(parse_setting(e, model) for e in effect or [])
    out = result_file(out, "flight.csv")
    file_kind(out)
    with working(f"flying {seconds:g} s") as progress:
        flown: dict[str, Any] = record_flight(
            model, effects, trajectory, seconds, seed, report=progress
        )
    name = name_in_log(model, vehicle)
    log = FlightLog(**flown, name=out.stem, vehicle=name)
    write_log(log, out)
    run.record = out.with_name(f"{stem(out)}.run.json")
    console.print(
        f"{len(log.t)} samples of {trajectory} by {model.name} with "
        f"{', '.join(e.name for e in effects) or 'no undeclared effect'}",
    )
    say(out)
    return {
        "samples": len(log.t),
        "vehicle": model.name,
        "trajectory": trajectory,
        "effects": {e.name: dict(e.coefficients) for e in effects},
    }
