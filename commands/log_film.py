"""A film of a logged flight, with the estimated wrench as arrows."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.errors import InputError
from .terminal import working

if TYPE_CHECKING:
    from ..dynamics.vehicle import Vehicle
    from ..envs.replay import Flight
    from ..identification.logs.flight_log import FlightLog
    from ..identification.wrench_series import WrenchSeries

Rows = NDArray[np.int64]


def shown_rows(log: "FlightLog", path: Path, begin: float, seconds: float) -> Rows:
    """Return the rows of a log that a film shows.

    Args:
        log: the flight.
        path: of the log, for errors.
        begin: start of the film, s after that of the log.
        seconds: longest duration.

    Raises:
        InputError: the log has fewer than two rows there.
    """
    since = log.t - log.t[0]
    if begin >= since[-1]:
        raise InputError(
            f"--film-from {begin:g}: {path} ends after {since[-1]:.6g} s; expected a time before "
            f"that"
        )
    rows = np.flatnonzero((since >= begin) & (since <= begin + seconds))
    if len(rows) < 2:
        raise InputError(
            f"--film-seconds {seconds:g}: {path} has {len(rows)} sample(s) there; expected a "
            f"longer duration"
        )
    return rows


def flight_of(log: "FlightLog", series: "WrenchSeries") -> "Flight":
    """Return a logged flight as it is drawn: where motion capture lost the vehicle, the filter's
    own pose.
    """
    from ..envs.replay import Flight

    return Flight(
        series.t,
        series.position,
        series.quaternion,
        series.force,
        series.torque,
        log.force,
        log.torque,
    )


def draw_film(
    title: str,
    model: "Vehicle",
    whole: "Flight",
    rows: Rows,
    folder: Path,
    kinds: Sequence[str],
    view: bool,
) -> list[Path]:
    """Draw a part of a flight as films, or in a window; return the files.

    Args:
        title: what flew.
        model: its vehicle.
        whole: the flight.
        rows: of it that are shown.
        folder: for the files.
        kinds: of films, ``gif`` and ``mp4``.
        view: show the flight in a window instead.
    """
    from ..envs.captions import Caption
    from ..envs.drawing import Viewer
    from ..envs.replay import arrow_scales, drawn_arm, pictures
    from ..envs.video import FPS
    from .filming import SIZE, films

    part = whole.part(rows)
    arm = drawn_arm(part, model)
    scales, larger = arrow_scales(part, arm), arm / model.arm_l
    viewer = Viewer("human" if view else "rgb_array", *SIZE)
    seconds = float(part.t[-1] - part.t[0])
    total = max(1, int(seconds * FPS))

    def caption(k: int) -> Caption:
        """Return the words beside a sample."""
        force, torque = part.true_force, part.true_torque
        way, dt = (x[k] - x[max(k - 1, 0)] for x in (part.position, part.t))
        speed = np.linalg.norm(way) / max(dt, 1e-6)
        return Caption(
            title,
            float(part.t[k] - whole.t[0]),
            part.force[k],
            float(part.torque[k, 2]),
            None if force is None else force[k],
            None if torque is None else float(torque[k, 2]),
            (
                f"height {part.position[k, 2]:.2f} m",
                f"speed {speed:.1f} m/s",
                *([f"vehicle drawn {larger:.1f} times as large"] if larger > 1.05 else []),
            ),
            viewer.pixels_per_metre(part.position[k]),
            scales,
        )

    try:
        with (
            working("drawing") as progress,
            films(folder, "film", list(kinds), seconds + 1.0, still="png") as (film, filmed),
        ):
            frames: Any = pictures(part, model, viewer, FPS)
            for count, (k, picture) in enumerate(frames):
                if view:
                    time.sleep(1.0 / FPS)
                else:
                    film(lambda: picture, lambda: caption(k))  # noqa: B023 - called at once
                progress(min(1.0, (count + 1) / total))
    finally:
        viewer.close()
    return filmed
