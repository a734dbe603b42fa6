"""Simulated flights: one episode of a task, or the log of a flight."""

from pathlib import Path
from typing import Any

from ..runtime.errors import InputError
from .terminal import (
    console,
    result_file,
    results_folder,
    run,
    say,
    show_table,
    working,
)


def fly(
    task: str = "FanTracking",
    scenario: str | None = None,
    controller: str | None = None,
    reward: str | None = None,
    imports: list[str] | None = None,
    seed: int = 4,  # a moving fan in FanTracking; the fan of seed 0 stands still
    vehicle: str | None = None,
    truth: str | None = None,
    effect: list[str] | None = None,
    gif: bool = False,
    film_seconds: float = 20.0,
    csv: bool = False,
    view: bool = False,
    out: Path = Path("results/fly"),
) -> dict[str, Any]:
    """Fly one simulated episode in a fan's jet or in wind. Draw the flight.

    Example: windwrench fly --scenario static --controller admittance --gif
    """
    from matplotlib.image import imsave

    from ..dynamics.effects import parse_setting
    from ..envs.captions import captioned
    from ..envs.definition import EPISODE_SECONDS
    from ..envs.gif import write_gif
    from ..evaluation.benchmark import Request
    from ..evaluation.episodes import fly_episode, time_series
    from ..evaluation.pictures import draw_episode
    from ..evaluation.tasks import import_files, make_pilot, short_names, task_of
    from ..runtime.whole_files import replaced

    if view and gif:
        raise InputError("--view: shows the flight in a window; expected no --gif")
    effects = [parse_setting(e) for e in effect or []]
    import_files(imports or ())
    known = task_of(task)
    controller, scenario = controller or known.flown, scenario or known.flown_in
    Request((controller,), (scenario,), 1, 0, task, reward, tuple(imports or ())).check()
    pilot = make_pilot(controller, task)
    env = known.make(
        scenario,
        reward,
        observation=getattr(pilot, "observation", None),
        render_mode="rgb_array" if gif else "human" if view else None,
        vehicle=vehicle,
        effects=effects or None,
        truth=truth,
        **({"width": 960, "height": 540} if gif or view else {}),
    )
    folder = results_folder(out)
    shown = short_names([controller])[controller]
    title = f"{task}, {scenario}: {shown}"
    every = 2 * max(1, round(known.decisions / (12.5 * EPISODE_SECONDS)))  # decisions a picture
    fps = known.decisions / (EPISODE_SECONDS * every)
    most = max(1, round(film_seconds * fps))
    flown: list[dict[str, Any]] = []
    pictures: list[Any] = []
    with working("flying", known.decisions) as progress:

        def each(info: dict[str, Any]) -> None:
            progress(more=1)
            if not gif:
                return
            flown.append(dict(info))
            if len(flown) % every == 0 and len(pictures) < most:
                said = {"time", "reward_tracking"} <= set(info)  # of the kit's own tasks
                drawn = captioned(env.unwrapped, title, flown) if said else env.render()
                pictures.append(drawn)

        episode = fly_episode(env, pilot, seed, each, known.decisions)
    env.close()
    paths = [folder / "fly.png"]
    draw_episode(episode, title, paths[0])
    if pictures:
        paths += [folder / "fly.gif", folder / "fly.scene.png"]
        write_gif(pictures, fps, paths[1])
        with replaced(paths[2]) as partial:
            imsave(partial, pictures[-1], format="png")
    if csv:
        from ..identification.logs.tables import write_csv

        write_csv(time_series(episode), folder / "fly.csv")
        paths.append(folder / "fly.csv")
    terminated = "yes" if episode.lost else "no"
    figures = (episode.rmse, episode.rmse_settled)
    stated = ("-" if figure != figure else f"{figure:.3f}" for figure in figures)
    show_table(
        ("controller", "scenario", "motion", "RMSE (m)", "after 3 s", "terminated", "return"),
        [(shown, scenario, episode.motion, *stated, terminated, f"{episode.total_reward:.1f}")],
    )
    say(*paths)
    return {
        "task": task,
        "controller": controller,
        "scenario": scenario,
        "motion": episode.motion,
        "rmse_m": episode.rmse,
        "rmse_settled_m": episode.rmse_settled,
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
