"""Flying: one episode in the jet, or a log of a flight."""

from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.table import Table

from .terminal import Out, VehicleOption, console, progress_bar, results_folder, say


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
    from ..controllers import make_controller
    from ..dynamics.effects import parse_setting
    from ..envs.fan_tracking import FanTrackingEnv
    from ..training.evaluate import DECISIONS, fly_episode
    from ..training.pictures import draw_episode

    if video:
        from ..envs.video import VideoWriter
    pilot = make_controller(controller)
    mode = "rgb_array" if video else "human" if view else None
    env = FanTrackingEnv(scenario, mode, vehicle, [parse_setting(e) for e in effect or []], width=960, height=640)
    folder = results_folder(out)
    with progress_bar() as progress:
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
    say(folder / "fly.png", *([folder / "fly.mp4", folder / "fly.scene.png"] if video else []))


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
    from ..dynamics.effects import parse_setting
    from ..dynamics.vehicle_file import load_vehicle
    from ..envs.recording import record_flight
    from ..identification.files import file_kind
    from ..identification.flight_log import FlightLog, write_log

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
    say(out)
