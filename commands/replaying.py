"""A logged flight drawn again."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..runtime.errors import InputError
from .logs import LogVehicleOption, log_notes, read_flights
from .terminal import MapOption, Out, ReaderOption, console, results_folder, say, working

if TYPE_CHECKING:
    from ..dynamics.vehicle import Vehicle
    from ..envs.replay import Flight
    from ..identification.logs.flight_log import FlightLog
    from ..identification.wrench_series import WrenchSeries


def flight_to_draw(
    log: "FlightLog", model: "Vehicle", progress: Callable[[float], None] = lambda share: None
) -> tuple["Flight", "WrenchSeries"]:
    """Return what ``replay`` draws of a log, and the estimate behind it: where motion capture lost
    the vehicle, the filter's own pose goes on.
    """
    from ..envs.replay import Flight
    from ..identification.wrench_series import estimate_log

    series = estimate_log(log, model, report=progress)
    drawn = Flight(
        series.t,
        series.position,
        series.quaternion,
        series.force,
        series.torque,
        log.force,
        log.torque,
    )
    return drawn, series


def replay(
    log: Annotated[Path, typer.Argument(help="Flight log: a table, or of an autopilot or a bag.")],
    reader: ReaderOption = None,
    map: MapOption = None,
    vehicle: LogVehicleOption = None,
    video: Annotated[
        bool, typer.Option("--video", help="Also write a video, replay.mp4 (video extra).")
    ] = False,
    gif: Annotated[
        bool, typer.Option("--gif", help="Also write an animation, replay.gif.")
    ] = False,
    rrd: Annotated[
        bool,
        typer.Option(
            "--rrd", help="Also write a recording for the Rerun viewer, replay.rrd (rerun extra)."
        ),
    ] = False,
    view: Annotated[bool, typer.Option("--view", help="Show the flight in a window.")] = False,
    begin: Annotated[
        float,
        typer.Option(
            "--from", min=0.0, help="Start time of the replay, s from the start of the log."
        ),
    ] = 0.0,
    film_seconds: Annotated[
        float, typer.Option(min=0.1, help="Longest duration of the replay, s.")
    ] = 30.0,
    out: Out = Path("results/replay"),
) -> dict[str, Any]:
    """Draw a logged flight and its wrench. The external wrench is drawn as arrows; write the last
    frame, and video or animation on request.

    Example: windwrench replay flight.csv --vehicle crazyflie --gif
    """
    import numpy as np

    from ..envs.captions import Caption, with_caption
    from ..envs.drawing import Viewer
    from ..envs.replay import arrow_scales, drawn_arm, pictures
    from ..envs.video import FPS, save_picture
    from .filming import SIZE, films

    (flight,), model = read_flights([log], reader, vehicle, map)
    length = float(flight.t[-1] - flight.t[0])
    if begin >= length:
        raise InputError(
            f"--from {begin:g}: {log} ends after {length:.6g} s; expected a time before that"
        )
    folder = results_folder(out)
    with working("estimating") as progress:
        whole, series = flight_to_draw(flight, model, progress)
    shown = np.flatnonzero(
        (flight.t - flight.t[0] >= begin) & (flight.t - flight.t[0] <= begin + film_seconds)
    )
    if len(shown) < 2:
        raise InputError(
            f"--film-seconds {film_seconds:g}: {log} has {len(shown)} sample(s) there; expected a "
            f"longer duration"
        )
    part = whole.part(shown)
    kinds = [kind for kind, wanted in (("mp4", video), ("gif", gif)) if wanted]
    arm = drawn_arm(part, model)
    scales = arrow_scales(part, arm)
    larger = arm / model.arm_l
    viewer = Viewer("human" if view else "rgb_array", *SIZE)
    total = max(1, int((part.t[-1] - part.t[0]) * FPS))

    def caption(k: int) -> Caption:
        """Say what one of the samples shown holds."""
        true = part.true_force is not None and part.true_torque is not None
        speed = np.linalg.norm(part.position[k] - part.position[max(k - 1, 0)])
        speed /= max(part.t[k] - part.t[max(k - 1, 0)], 1e-6)
        return Caption(
            f"{flight.name}: {model.name}",
            float(part.t[k] - flight.t[0]),
            part.force[k],
            float(part.torque[k, 2]),
            part.true_force[k] if true and part.true_force is not None else None,
            float(part.true_torque[k, 2]) if true and part.true_torque is not None else None,
            (
                f"height {part.position[k, 2]:.2f} m",
                f"speed {speed:.1f} m/s",
                *([f"vehicle drawn {larger:.1f} times as large"] if larger > 1.05 else []),
            ),
            viewer.pixels_per_metre(part.position[k]),
            scales,
        )

    last: tuple[Any, int] | None = None
    try:
        with (
            working("drawing") as progress,
            films(folder, "replay", kinds, film_seconds, still="png") as film,
        ):
            for count, (k, picture) in enumerate(pictures(part, model, viewer, FPS)):
                if view:
                    time.sleep(1.0 / FPS)
                else:
                    film(lambda: picture, lambda: caption(k))  # noqa: B023 - called at once
                    last = picture, k
                progress(min(1.0, (count + 1) / total))
        written = [folder / f"replay.{kind}" for kind in kinds]
        if last is not None:
            save_picture(with_caption(last[0], caption(last[1])), folder / "replay.png")
            written.append(folder / "replay.png")
    finally:
        viewer.close()
    if rrd:
        from ..envs.rerun_export import write_rrd

        write_rrd(whole, model, folder / "replay.rrd")
        written.append(folder / "replay.rrd")
    log_notes(series.notes)
    console.print(f"{flight.name}: vehicle {model.name}", highlight=False, markup=False)
    say(*written)
    return {
        "log": flight.name,
        "vehicle": model.name,
        "samples": len(flight.t),
        "seconds": length,
        "largest_force_N": np.linalg.norm(part.force, axis=1).max(),
        "largest_torque_Nm": np.linalg.norm(part.torque, axis=1).max(),
    }
